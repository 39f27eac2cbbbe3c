"""Settled points as evidence: rows of errors in variables, with Student noise per point."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from scipy.special import gammaln

from rulec.effects.candidate import TIME, Candidate, DisturbanceLocation, Unknown
from rulec.knowledge.knowledge import has_no_zero
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import ERROR, Configuration, lasting
from rulec.mismatch.evidence.evidence import (
    Column,
    Evidence,
    Names,
    Noise,
    Point,
    Proposal,
    amplitudes_of,
    fewest,
)
from rulec.mismatch.evidence.prior import Prior
from rulec.mismatch.evidence.steady.fit import Fitted, evaluated, prior_of
from rulec.mismatch.evidence.steady.operating_state_means import likeness
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import (
    change_by,
    column_at,
    columns_of,
    has_drivers,
    references,
    starts,
    with_open_references,
)
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.evidence.steady.terms import terms_at
from rulec.mismatch.evidence.term import Term, bends

# Errors of form: no law, whether of the plant or of an effect, obeys its formula exactly.


def errors_of_form(
    plain: Fitted, open_: NDArray[np.bool_], laws: Sequence[DisturbanceLocation]
) -> tuple[Array, tuple[str, ...]]:
    """Rows of errors of form, shape (rows, errors), and the law of each.

    Each law has its own errors, as large as its accuracy. Two meters in one line share no law: no
    error of form explains a difference between them. Rows that count are flagged in `open_`.
    """
    rows, system = plain.rows, plain.rows.system
    flows = system.flows(Configuration())
    columns, law = [np.zeros((int(open_.sum()), 0))], []
    ways: dict[str, Array] = {}
    for location in laws:
        column = column_at(plain, location)
        if column is None:
            continue
        if location.module not in ways:
            alike = likeness(system, flows, location.module)
            ways[location.module] = _smooth_over(alike, limits.FORM_RANK)
        u = common.FORM_U * location.accuracy * np.nan_to_num(system.value_of(location))
        whole = column * u[rows.point]
        own = fewest((whole[:, None] * ways[location.module][rows.point])[open_], common.FORM_KNOWN)
        columns.append(own)
        law += [location.id] * own.shape[1]
    return np.concatenate(columns, axis=1), tuple(law)


def errors_of_effects(now: Fitted, open_: NDArray[np.bool_]) -> Array:
    """Each effect's own term times smooth functions of its drivers, shape (rows, functions).

    The driver of a growing fault is its growth so far, as it need not grow linearly. Drivers take
    the values that the model predicts: functions of a reading would explain the noise of that
    reading.
    """
    rows, setting = now.rows, now.setting
    values = {**rows.system.inputs, **now.predicted}
    columns = []
    for candidate in setting.joined:
        drivers = [values[n] for n in dict.fromkeys(candidate.drivers.values())]
        if candidate.sort == "fault":
            own = {u.id for u in candidate.unknowns}
            courses = (c for c in setting.courses if c.unknown in own)
            drivers = [c.risen for c in courses if c.risen is not None]
        shapes = [shape for driver in drivers for shape in _shapes(driver)]
        if not shapes or all(u.null is None or u.fixed for u in candidate.unknowns):
            continue
        term = change_by(now, candidate)
        for shape in shapes:
            column = rows.column(now.maps, {i: v * shape for i, v in term.items()})
            columns.append(column[open_])
    return np.stack(columns, axis=1) if columns else np.zeros((int(open_.sum()), 0))


def _shapes(driver: Array | float) -> Sequence[Array]:
    values = np.asarray(driver, dtype=float)
    return bends(np.nan_to_num(values, nan=float(np.nanmedian(values))))


# Errors of sensors: slow ones within their class, and those of inputs that are held.


def moving_sensors(plain: Fitted, open_: NDArray[np.bool_]) -> Array:
    """Rows of sensor errors that move slowly within their class, shape (rows, errors)."""
    rows, system = plain.rows, plain.rows.system
    lasting = {ERROR + name for name in system.shared}
    errors = [i for i, name in enumerate(plain.prior.names) if name in lasting]
    if not (system.data.timed and errors):
        return np.zeros((int(open_.sum()), 0))
    course = _smooth_in_time(system.data.time, system.data.source)[rows.point[open_]]
    tables = [plain.jacobian[open_][:, [i]] * course for i in errors]
    return fewest(np.concatenate(tables, axis=1), common.MOVING_SHARES[-1])


def held_inputs(plain: Fitted, open_: NDArray[np.bool_]) -> Array:
    """Rows of the errors of inputs that are held over several points, shape (rows, errors)."""
    rows, data = plain.rows, plain.rows.system.data
    flows = rows.system.flows(Configuration())
    columns = [np.zeros((len(rows), 0))]
    for name, slopes in flows.by_reading.items():
        values = data.values[name]
        visit = np.cumsum(np.abs(np.diff(values, prepend=np.nan)) > 1e-9 * np.abs(values))
        longer = np.flatnonzero(np.bincount(visit) > 1)
        if len(longer):
            noise = np.nan_to_num(data.noise[name][rows.point])
            shown = rows.column(plain.maps, slopes) * noise
            columns.append(shown[:, None] * (visit[rows.point, None] == longer))
    return np.asarray(np.concatenate(columns, axis=1)[open_])


def _smooth_over(correlation: Array, least: float) -> Array:
    """Independent functions, shape (n, functions), whose sum has the given correlation, shape (n,
    n). Those below a share `least` of the largest variance are omitted."""
    size, ways = np.linalg.eigh(correlation)
    kept = size > least * size.max()
    return np.asarray(ways[:, kept] * np.sqrt(size[kept]))


def _smooth_in_time(time: Array, source: NDArray[np.intp]) -> Array:
    """Independent smooth courses of unit total variance, own ones for each recording, shape (n,
    courses)."""
    found = []
    for own in np.unique(source):
        here = np.flatnonzero(source == own)
        phase = (time[here] - time[here[0]]) / max(float(np.ptp(time[here])), 1e-300)
        alike = np.exp(-0.5 * ((phase[:, None] - phase[None, :]) / common.FORM_LENGTH) ** 2)
        smooth = _smooth_over(alike, limits.MOVING_RANK)
        whole = np.zeros((len(time), smooth.shape[1]))
        whole[here] = smooth
        found.append(whole)
    return np.concatenate(found, axis=1)


@dataclass(frozen=True)
class SteadyPoint:
    """A fit to settled points, reduced to its open rows, flags `open` of shape (all rows,)."""

    fitted: Fitted
    open: NDArray[np.bool_]

    @property
    def setting(self) -> Configuration:
        """The joined candidates and all values."""
        return self.fitted.setting

    @cached_property
    def residual(self) -> Array:
        """Residual, shape (rows,), in units of its noise."""
        return self.fitted.residual[self.open]

    @cached_property
    def jacobian(self) -> Array:
        """Slopes of the residual, shape (rows, values)."""
        return self.fitted.jacobian[self.open]


def fit_of(point: Point) -> Fitted:
    """The fit to settled points."""
    assert isinstance(point, SteadyPoint)
    return point.fitted


class SteadyEvidence(Evidence):
    """What all models of the settled points of one recording have in common.

    `rows` are often of means of states, `points` those of all settled points. Where laws and
    sensors are `exact`, laws have no error of form and errors of sensors are constant.
    """

    noises = (limits.NOISE_SCALES,)
    """Sizes of the noise to try, relative to the expected one."""
    usual_noise = (1.0,)

    def __init__(self, rows: Rows, points: Rows | None = None, *, exact: bool = False) -> None:
        super().__init__()
        self.system = system = rows.system
        self.rows, self.points = rows, rows if points is None else points
        self.readings = frozenset(s.id for s in system.ruleset.signals)
        self.candidates = system.candidates
        inputs = [s for s in system.ruleset.signals if s.is_input and s.id in system.data.noise]
        self.term_count = len(system.builder.locations) * max(len(inputs) + system.data.timed, 1)
        self.open = system.data.open[rows.point]
        self.point = rows.point[self.open]
        self.count = len(self.point)
        prior = prior_of(system, Configuration())
        plain = evaluated(rows, Configuration(), prior, prior.mean, system.data.open)
        laws = () if exact else system.builder.laws
        self.forms, self.law = errors_of_form(plain, self.open, laws)
        self.moving = np.zeros((self.count, 0)) if exact else moving_sensors(plain, self.open)
        self.held = held_inputs(plain, self.open)
        self.group: NDArray[np.intp] = np.unique(rows.group[self.open], return_inverse=True)[1]
        self.rank = np.bincount(self.group).astype(float)
        freedom = limits.FREEDOM
        constants = gammaln((freedom + self.rank) / 2) - self.rank / 2 * np.log(freedom)
        self.constant = float(np.sum(constants - gammaln(freedom / 2)))

    def plain_prior(self, setting: Configuration) -> Prior:
        return prior_of(self.system, setting)

    def driven_by(self, driver: str) -> Array:
        data = self.system.data
        return data.clock if driver == TIME else data.values[driver]

    def share(self, candidate: Candidate, unknown: Unknown) -> float:
        return share_of(self.system, candidate, unknown)

    def evaluated(self, setting: Configuration, prior: Prior, at: Array) -> SteadyPoint:
        used = self.system.data.open
        return SteadyPoint(evaluated(self.rows, setting, prior, at, used), self.open)

    def columns(self, point: Point, candidates: Iterable[Candidate]) -> list[Column]:
        """Columns at several shapes and, of faults, at several onsets."""
        system, fitted = self.system, fit_of(point)
        found: list[Column] = []
        for candidate in candidates:
            amplitudes = amplitudes_of(candidate)
            if not amplitudes or not has_drivers(system, candidate):
                continue
            null = {u.id: n for u, n in amplitudes.items()}
            fixed = references(system, candidate)
            for shape in starts(system, candidate):
                own = {**null, **shape}
                table = columns_of(fitted, candidate, own, fixed)
                if table is None or not np.isfinite(table).all():
                    continue
                found += [
                    Column(candidate=candidate, amplitude=u, values=own, fixed=fixed, rows=rows)
                    for u, rows in zip(amplitudes, table[self.open].T, strict=True)
                    if rows.any()
                ]
        return [*found, *self._begun(found)] if system.data.timed else found

    def _begun(self, every: Sequence[Column]) -> Iterator[Column]:
        """Faults that begin during the recording, as a step or growing in proportion to time."""
        time = self.system.data.time
        onsets = np.quantile(time, np.linspace(0.06, 0.94, common.ONSETS)).tolist()
        growing = np.quantile(time, np.linspace(0.0, 0.9, limits.GROWING_ONSETS)).tolist()
        ways = [*((since, False) for since in onsets), *((since, True) for since in growing)]
        courses = [lasting("", since, time, grows=grows) for since, grows in dict.fromkeys(ways)]
        shares = [(course, course.share(0)[self.point]) for course in courses]
        for column in (c for c in every if c.candidate.sort == "fault"):
            name, null = column.amplitude.id, column.amplitude.null or 0.0
            for course, share in shares:
                rows = column.rows * share
                if rows.any():
                    own = replace(course, unknown=name)
                    yield replace(column, course=own, values={f"{name}#0": null}, rows=rows)

    def terms_of_any_size(self, point: Point) -> list[Term]:
        return terms_at(fit_of(point), self.open)

    def starting_points(
        self, setting: Configuration, every: Sequence[Column], proposals: Sequence[Proposal]
    ) -> Iterator[tuple[Names, Configuration]]:
        """From all shapes that some view of the recording found best, by the largest gain of each,
        with usual and with free reference conditions."""
        for one in {one.shapes: one for one in reversed(proposals)}.values():
            there = one.joined_to(setting)
            yield one.names, there
            new = [column.candidate for column, _ in one.starts]
            free = with_open_references(self.system, there, new)
            if free is not None:
                yield one.names, free

    def effect_forms(self, now: Point) -> Array:
        return errors_of_effects(fit_of(now), self.open)

    def alike(self, noise: Noise) -> Array:
        return np.full(self.count, noise[0] ** -2)

    def noise_odds(self, noise: Noise) -> float:
        return -0.5 * float(np.log(noise[0]) / np.log(limits.NOISE_KNOWN)) ** 2

    def shown(self, columns: Array) -> dict[str, float]:
        squares: dict[str, float] = {}
        for column in columns.T:
            whole = np.zeros(len(self.rows))
            whole[self.open] = column
            for cell in self.rows.cells:
                off = np.linalg.solve(cell.whitener, cell.table(whole).T[:, :, None])[:, :, 0]
                off = off[self.rows.system.data.open[cell.points]]
                for name, errors in zip(cell.outputs, off.T, strict=True):
                    square = float(np.mean(errors**2)) if len(errors) else 0.0
                    squares[name] = squares.get(name, 0.0) + square
        return {name: float(np.sqrt(square)) for name, square in squares.items()}

    def likelihood(self, residual: Array, noise: Noise) -> float:
        return self.constant - float(self.lost(residual, noise[0]).sum())

    def lost(self, residual: Array, scale: float) -> Array:
        """Loss of log likelihood by each group of rows, shape (groups,)."""
        square = np.bincount(self.group, residual**2) / scale**2
        far = np.log1p(square / limits.FREEDOM)
        return np.asarray(self.rank * np.log(scale) + 0.5 * (limits.FREEDOM + self.rank) * far)

    def expected_weights(self, noise: Noise) -> Array:
        """Mean information of each row, shape (rows,): Fisher information of Student noise."""
        each = (limits.FREEDOM + self.rank) / (limits.FREEDOM + self.rank + 2.0) / noise[0] ** 2
        return np.asarray(each[self.group])

    def weights(self, residual: Array, noise: Noise) -> Array:
        far = np.bincount(self.group, residual**2) / noise[0] ** 2
        each = (limits.FREEDOM + self.rank) / (limits.FREEDOM + far) / noise[0] ** 2
        return np.asarray(each[self.group])


def settled(evidence: Evidence) -> SteadyEvidence:
    """The evidence, where it is that of settled points."""
    assert isinstance(evidence, SteadyEvidence)
    return evidence


def share_of(system: System, candidate: Candidate, unknown: Unknown) -> float:
    """Largest relative change of estimates per amplitude, over all shapes.

    For a reading whose zero is arbitrary it is relative to the range of the sensor.
    """
    null = {u.id: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}
    fixed, shares = references(system, candidate), []
    plain = system.flows(Configuration()).values
    reading = _without_zero(system, candidate)
    for shape in starts(system, candidate):
        setting = Configuration().joining(candidate, {**null, **shape}, fixed)
        modules = system.reached(candidate.observers)
        flows = system.flows(setting, [unknown.id], modules=modules)
        for i, slope in flows.by_value[unknown.id].items():
            whole = plain[i]
            if reading is not None:
                whole = flows.by_reading[reading][i] * span(system, reading)
            with np.errstate(invalid="ignore", divide="ignore"):
                share = np.broadcast_to(slope / whole, plain[i].shape)
            share = share[system.data.open & system.valid[i] & np.isfinite(share)]
            shares.append(float(np.sqrt(np.mean(share**2))) if len(share) else 0.0)
    return max(shares, default=0.0) or 1.0


def _without_zero(system: System, candidate: Candidate) -> str | None:
    """The reading that a candidate corrects, if its zero is arbitrary.

    A share of a temperature means nothing: 5 % of 20 degC would be 15 kelvin.
    """
    signal, plant = f"{candidate.module}.{candidate.place}", system.builder.network.plant
    if signal not in system.shared:
        return None
    own = plant.modules[candidate.module].type.signals[candidate.place]
    return signal if has_no_zero(own, plant.knowledge.units) else None


def span(system: System, signal: str) -> float:
    """Range of a sensor, SI, or of its readings where none is stated."""
    low, high = system.ruleset.signal_by_id[signal].ends
    if np.isfinite(high - low):
        return high - low
    values = system.data.values[signal]
    return float(np.nanmax(values) - np.nanmin(values))
