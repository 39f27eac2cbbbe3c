"""A recording of a plant that stores as evidence: errors of a simulation, and their noise.

A reading has white noise, estimated from its third differences, and a correlated error whose size
and correlation time are estimated by likelihood. Models of plants that store are off for long
stretches, so rows are innovations.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.columns import runs_where
from rulec_runtime.simulation.balances import TIME, RanAway

from rulec.effects.candidate import MEDIAN, Candidate, Unknown
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.evidence import (
    Column,
    Evidence,
    Names,
    Noise,
    Point,
    Proposal,
    amplitudes_of,
    climbed,
    fewest,
)
from rulec.mismatch.evidence.prior import Prior, usual
from rulec.mismatch.evidence.stores.errors_of_form import errors_of_form, forms_of_effects
from rulec.mismatch.evidence.stores.fitted_curve import Domain, domain_over
from rulec.mismatch.evidence.stores.noise import errors_of_sensors, innovations
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.evidence.stores.starting_values import from_afar, nearest, ways_to_join
from rulec.mismatch.evidence.term import Term, term_with


@dataclass(frozen=True)
class StoredPoint:
    """A simulation at some values, in units of the noise of readings: see `Point`."""

    setting: Configuration
    residual: Array
    jacobian: Array


class StoresEvidence(Evidence):
    """What all models of one recording of a plant that stores have in common.

    Errors of form and of sensors are linearised at the model `near`.
    """

    ended = limits.STORES_ENDED
    most = limits.DEEPEST
    # A term is linearised at the model without it: the residual may be its own curvature.
    beside_terms = False

    def __init__(self, problem: SimulationProblem, near: Configuration | None = None) -> None:
        super().__init__()
        self.problem, self.candidates = problem, problem.candidates
        self.term_count = len(problem.locations) * len(problem.drivers)
        self.readings = frozenset(s.id for s in problem.ruleset.signals)
        self.count = int(sum(flags.sum() for flags in self._counted.values()))
        near = near or Configuration()
        ids, values = near.ids, {**problem.plain_values, **near.values, **near.fixed}
        law, forms = [], [np.zeros((self.count, 0))]
        for location, moved in errors_of_form(problem, ids, values):
            own = fewest(self._table(moved), common.FORM_KNOWN, limits.FORM_RANK)
            forms.append(own)
            law += [location.id] * own.shape[1]
        self.forms, self.law = np.concatenate(forms, axis=1), tuple(law)
        self.held = self._table(errors_of_sensors(problem, ids, values))
        self.of_class = (self.held,)
        self.noises = tuple(self._noises())
        self.usual_noise = tuple(axis[len(axis) // 2] for axis in self.noises)
        self.moving = np.zeros((self.count, 0))

    def about(self, near: Configuration) -> StoresEvidence:
        """The same, linearised at another model."""
        there = StoresEvidence(self.problem, near)
        # Sizes follow from the plain model.
        there._sizes = self._sizes
        return there

    def _table(self, moved: Array) -> Array:
        """Changes of readings, shape (signals * samples, columns), SI, as rows in their noise."""
        columns = []
        for column in moved.T:
            own = zip(self._counted.items(), np.split(column, len(self._counted)), strict=True)
            columns.append(np.concatenate([v[flags] / self.white[n] for (n, flags), v in own]))
        return np.stack(columns, axis=1)

    @cached_property
    def _counted(self) -> dict[str, NDArray[np.bool_]]:
        """Samples that count; short gaps are closed, as a lasting error is the same after them."""
        record = self.problem.record
        return {n: _bridged(np.isfinite(v)) & record.open for n, v in record.measured.items()}

    @cached_property
    def _measured(self) -> dict[str, Array]:
        time, found = self.problem.time, {}
        for name, values in self.problem.record.measured.items():
            finite = np.isfinite(values)
            found[name] = np.interp(time, time[finite], values[finite])
        return found

    @cached_property
    def white(self) -> dict[str, float]:
        """Standard deviation of the noise of each reading, SI."""
        return {name: max(floor, 1e-12) for name, floor in self.problem.floors.items()}

    @cached_property
    def _runs(self) -> list[list[slice]]:
        """Rows without a gap between them, for each signal."""
        found, first = [], 0
        for flags in self._counted.values():
            own = []
            for a, b in runs_where(flags, 1):
                own.append(slice(first, first + b - a))
                first += b - a
            found.append(own)
        return found

    def _noises(self) -> Iterator[tuple[float, ...]]:
        """Sizes of the correlated error to try, in white noise, correlation times in samples, and
        smoothness, for each signal."""
        for name, flags in self._counted.items():
            span = float(np.std(self._measured[name][flags])) / self.white[name]
            steps = int(np.ceil(np.log2(12.0 * max(span, 1.0))))
            yield limits.NEGLIGIBLE_ERROR, *(0.25 * 2.0 ** np.arange(1 + steps)).tolist()
            longest = int(np.log2(len(self.problem.time) / 2.0))
            yield tuple((2.0 ** np.arange(longest + 1)).tolist())
            yield limits.SMOOTHNESS

    def likely_noises(self, residual: Array) -> list[Noise]:
        """The likeliest noise by a residual, shape (rows,), with each smoothness for all signals,
        and with the likeliest smoothness of each signal."""
        of_signals = [self._likely(residual, number) for number in range(len(self._runs))]
        alike = [[own[i][1] for own in of_signals] for i in range(len(limits.SMOOTHNESS))]
        best = [max(own)[1] for own in of_signals]
        return [tuple(itertools.chain(*each)) for each in (*alike, best)]

    def promise(self, setting: Configuration) -> float:
        """Log likelihood of a setting with its likeliest noise, without a refit."""
        residual, _ = self.simulated(setting)
        if not np.isfinite(residual).all():
            return -np.inf
        own = (max(self._likely(residual, number))[0] for number in range(len(self._runs)))
        return float(sum(own))

    def _likely(self, residual: Array, number: int) -> list[tuple[float, Noise]]:
        """The likeliest noise of one signal for each smoothness, with its log likelihood."""
        runs = self._runs[number]
        sizes, lasts, smoothnesses = self.noises[3 * number : 3 * number + 3]
        left = residual[runs[0].start : runs[-1].stop]
        spread = float(np.sqrt(np.mean(left**2)))
        begin = int(np.argmin(np.abs(np.array(sizes) - spread))), len(lasts) // 2
        found: list[tuple[float, Noise]] = []
        for smoothness in smoothnesses:

            @cache
            def score(index: tuple[int, ...], smoothness: float = smoothness) -> float:
                own = innovations(sizes[index[0]], lasts[index[1]], smoothness)
                return -0.5 * float(np.sum(own.of(left, runs) ** 2)) - own.logs(runs)

            index = climbed(score, begin, [len(sizes), len(lasts)], ())
            found.append((score(index), (sizes[index[0]], lasts[index[1]], smoothness)))
        return found

    def levels(self, noise: Noise, rest: Callable[[], Array], *, alone: bool) -> list[Noise]:
        """Independent errors, and for the plain model the likeliest noises of each smoothness."""
        left = rest()
        independent: list[float] = []
        for runs in self._runs:
            own = left[runs[0].start : runs[-1].stop]
            independent += [float(np.sqrt(np.mean(own**2))), limits.AT_ONCE_GONE, 1.0]
        return [tuple(independent), *(self.likely_noises(left) if alone else ())]

    def shown(self, columns: Array) -> dict[str, float]:
        found = {}
        for (name, white), runs in zip(self.white.items(), self._runs, strict=True):
            squares = np.sum(columns[runs[0].start : runs[-1].stop] ** 2, axis=1)
            found[name] = white * float(np.sqrt(np.mean(squares)))
        return found

    def noise_odds(self, noise: Noise) -> float:
        axes, odds = self.noises, 0.0
        for i, size in enumerate(noise[::3]):
            if size > limits.NEGLIGIBLE_ERROR:
                odds -= float(np.sum([np.log(len(axis)) for axis in axes[3 * i : 3 * i + 3]]))
        return odds

    def whitener(self, columns: Array) -> Callable[[Noise], Array]:
        """`whitened` for fixed columns, calculated once per signal and noise."""

        @cache
        def part(number: int, size: float, lasts: float, smoothness: float) -> Array:
            runs = self._runs[number]
            own = innovations(size, lasts, smoothness)
            return own.of(columns[runs[0].start : runs[-1].stop], runs)

        def whitened(noise: Noise) -> Array:
            return np.concatenate([part(i, *own) for i, own in enumerate(_of_signals(noise))])

        return whitened

    def likelihood(self, residual: Array, noise: Noise) -> float:
        each = zip(_of_signals(noise), self._runs, strict=True)
        logs = sum(innovations(*own).logs(runs) for own, runs in each)
        return -0.5 * float(residual @ residual) - logs

    def plain_prior(self, setting: Configuration) -> Prior:
        return self.problem.prior(setting)

    def driven_by(self, driver: str) -> Array:
        return self.course(Configuration(), driver)

    def share(self, candidate: Candidate, unknown: Unknown) -> float:
        """Largest relative change of flows or readings per amplitude, over all shapes."""
        fixed, shares = self.references(Configuration(), candidate), []
        plain = unknown.null or 0.0
        null = {u.id: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}
        for shape in self.starts(Configuration(), candidate):
            values = {**self.problem.plain_values, **fixed, **null, **shape}
            values[unknown.id] = plain + 1e-3 * (usual(unknown) - plain)
            try:
                course = self.problem.simulate((candidate.id,), values, [unknown.id]).course
            except RanAway:
                continue
            names = self.problem.balances((candidate.id,)).outputs
            sizes = np.sqrt(np.mean(course.shown**2, axis=0))
            slopes = np.sqrt(np.mean(course.slopes[:, :, 0] ** 2, axis=0))
            moved = slopes / np.maximum(sizes, 1e-300)
            flows = [i for i, n in enumerate(names) if n.startswith(("inflow:", "outflow:"))]
            own = [i for i in flows if names[i].partition(":")[2] in candidate.modules]
            reading = f"shown:{candidate.module}.{candidate.place}"
            for rows in ([i for i, n in enumerate(names) if n == reading], own, flows):
                best = max((float(moved[i]) for i in rows), default=0.0)
                if best > 0.0:
                    shares.append(best)
                    break
        return max(shares, default=0.0) or 1.0 / abs(usual(unknown) - plain)

    def evaluated(self, setting: Configuration, prior: Prior, at: Array) -> StoredPoint:
        """The model at some coordinates; with an infinite residual where it runs away."""
        there = replace(setting, values={**setting.values, **prior.values(at)})
        residual, slopes = self.simulated(there, prior.names)
        return StoredPoint(there, residual, slopes * prior.coordinates.slopes(at))

    def columns(self, point: Point, candidates: Iterable[Candidate]) -> list[Column]:
        """Columns of slopes near the null and, as laws bend, of secants to each usual strength."""
        setting, found = point.setting, list[Column]()
        taken = {(c.name, c.place, m) for c in setting.joined for m in c.modules}
        plain, _ = self.simulated(setting)
        for candidate in candidates:
            if taken & {(candidate.name, candidate.place, m) for m in candidate.modules}:
                continue
            amplitudes = amplitudes_of(candidate)
            null = {u.id: n for u, n in amplitudes.items()}
            near = {u.id: n + common.GENTLE * (usual(u) - n) for u, n in amplitudes.items()}
            fixed = self.references(setting, candidate)
            for shape in self.starts(setting, candidate):
                start = {**null, **shape}
                there = setting.joining(candidate, {**near, **shape}, fixed)
                _, slopes = self.simulated(there, [u.id for u in amplitudes])
                changes = list(zip(amplitudes, slopes.T, strict=True))
                for unknown, n in amplitudes.items():
                    for strength in (s for s in unknown.starts if s != n):
                        values = {**start, unknown.id: strength}
                        there = setting.joining(candidate, values, fixed)
                        change = self.simulated(there)[0] - plain
                        changes.append((unknown, change / (strength - n)))
                found += [
                    Column(candidate=candidate, amplitude=u, values=start, fixed=fixed, rows=rows)
                    for u, rows in changes
                    if np.isfinite(rows).all() and rows.any()
                ]
        return found

    def terms_of_any_size(self, point: Point) -> list[Term]:
        problem, found = self.problem, list[Term]()
        for driver in problem.drivers:
            course = self.course(point.setting, driver)[problem.record.open]
            for location in problem.locations:
                domain = domain_over(location, driver, course)
                if domain is not None:
                    found += self._terms_over(point.setting, domain)
        return found

    def _terms_over(self, setting: Configuration, domain: Domain) -> Iterator[Term]:
        parts, knots = domain.parts(self.problem.builder)
        for part in parts:
            own = {u.id: knots[u.id] for u in part.unknowns if u.fixed}
            nothing = {u.id: 0.0 for u in part.unknowns if not u.fixed}
            setting = setting.joining(part, nothing, own)
        coefficients = [u.id for part in parts for u in part.unknowns if not u.fixed]
        slopes = self.simulated(setting, coefficients)[1] @ domain.bends
        for basis in domain.bases():
            columns, location = slopes @ basis.at(domain.knots), domain.location
            term = term_with(columns, location.id, location, domain.driver, basis, np.zeros(0))
            if term is not None:
                yield term

    def starting_points(
        self, setting: Configuration, every: Sequence[Column], proposals: Sequence[Proposal]
    ) -> Iterator[tuple[Names, Configuration]]:
        """The most promising beginning of each set, by least squares from several ones, of the most
        promising sets.

        Of all sets the better half goes on: a law with a bend shows late how well it fits.

        Source: successive halving (Karnin, Koren and Somekh 2013).
        """
        promise, groups = itemgetter(0), dict[Names, list[Proposal]]()
        for one in proposals:
            groups.setdefault(one.names, []).append(one)
        # Far from a model slopes hardly predict the gain of a large effect.
        for column in () if setting.joined else every:
            alone = Proposal(0.0, ((column, usual(column.amplitude)),))
            groups.setdefault(alone.names, [alone])
        tried = []
        for names, found in groups.items():
            kinds = ways_to_join(setting, found, self.references, self.starts)
            best = [way for kind in kinds if (way := nearest(self.problem, kind)) is not None]
            # Kinds often agree on the best one.
            ways = {tuple(way.values.items()): way for way in best}.values()
            near = [self._tried(names, way, limits.EVALUATIONS_OF_EACH, 1) for way in ways]
            tried += [max(near, key=promise)] if near else []
        # Larger sets have improved more by now, so both kinds are kept apart.
        few, more = ([t for t in tried if (len(t[1]) > 1) is pair] for pair in (False, True))
        for kind, most in ((few, common.SETS_REFITTED), (more, common.SETS_REFITTED // 2)):
            half = sorted(kind, key=promise, reverse=True)[: max(most, len(kind) // 2)]
            ends = [max(one, self._tried(*one[1:]), key=promise) for one in half]
            for _, names, way in sorted(ends, key=promise, reverse=True)[:most]:
                yield names, way

    def _tried(
        self,
        names: Names,
        way: Configuration,
        evaluations: int = limits.EVALUATIONS,
        fits: int = limits.FITS_FROM_AFAR,
    ) -> tuple[float, Names, Configuration]:
        """Least squares from a setting: how promising its end is, and the end."""
        try:
            there = from_afar(self.problem, way, evaluations, fits)
        except np.linalg.LinAlgError:
            return -np.inf, names, way
        return self.promise(there), names, there

    def simulated(self, setting: Configuration, names: Sequence[str] = ()) -> tuple[Array, Array]:
        """Errors of a model in the noise of readings, shape (rows,), and their slopes by the named
        values, SI, shape (rows, names)."""
        values = {**setting.fixed, **setting.values}
        try:
            with np.errstate(all="ignore"):
                model = self.problem.simulate(setting.ids, values, names)
        except RanAway:
            return np.full(self.count, np.inf), np.zeros((self.count, len(names)))
        residual, slopes = [], []
        for name, flags in self._counted.items():
            off = model.shown[name] - self._measured[name]
            residual.append(off[flags] / self.white[name])
            slopes.append(model.slopes[name][flags] / self.white[name])
        whole = np.concatenate(slopes)
        # Where a tank runs empty slopes overflow: such a sample is useless to first order.
        whole[~np.all(np.abs(whole) < limits.OVERFLOWN, axis=1)] = 0.0
        return np.concatenate(residual), whole

    def effect_forms(self, now: Point) -> Array:
        values = {**self.problem.plain_values, **now.setting.values, **now.setting.fixed}
        moved = list(forms_of_effects(self.problem, now.setting.joined, values))
        return self._table(np.stack(moved, axis=1)) if moved else np.zeros((self.count, 0))

    def course(self, setting: Configuration, name: str) -> Array:
        """Course of a driver, shape (n,), SI."""
        values = {**self.problem.plain_values, **setting.values, **setting.fixed}
        return self.problem.trajectory(setting.ids, values, name, self.problem.record.inputs)

    def references(self, setting: Configuration, candidate: Candidate) -> dict[str, float]:
        """Reference readings of parameters that stay fixed."""
        found = {}
        for unknown in (u for u in candidate.unknowns if u.fixed):
            course = self.course(setting, unknown.driver or TIME)
            ends = np.nanquantile(course, unknown.quantiles or MEDIAN)
            found[unknown.id] = 0.5 * float(ends[1] - ends[0]) if len(ends) == 2 else float(ends[0])
        return found

    def starts(self, setting: Configuration, candidate: Candidate) -> Iterator[dict[str, float]]:
        """Combinations of the starting values of shapes."""
        options: dict[str, Sequence[float]] = {}
        for unknown in candidate.unknowns:
            if unknown.fixed or unknown.null is not None:
                continue
            options[unknown.id] = unknown.starts
            if unknown.quantiles:
                course = self.course(setting, unknown.driver or TIME)
                options[unknown.id] = np.nanquantile(course, unknown.quantiles).tolist()
        for chosen in itertools.product(*options.values()):
            yield dict(zip(options, chosen, strict=True))


def _of_signals(noise: Noise) -> list[tuple[float, float, float]]:
    """Size, correlation time and smoothness of the correlated error of each signal."""
    return list(zip(noise[::3], noise[1::3], noise[2::3], strict=True))


def _bridged(flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
    at, found = np.flatnonzero(flags), flags.copy()
    for a, b in itertools.pairwise(at.tolist()):
        if b - a <= limits.BRIDGED_SAMPLES:
            found[a:b] = True
    return found
