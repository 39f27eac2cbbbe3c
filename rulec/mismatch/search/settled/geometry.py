"""What all models of settled points have in common: errors of form, and the weights of rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from scipy.sparse import csr_array
from scipy.special import gammaln

from rulec.effects.candidate import TIME, Candidate, DisturbanceLocation, Unknown
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.steady.configuration import ERROR, Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, Prior, evaluated, prior_of
from rulec.mismatch.evidence.steady.operating_state_means import likeness
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import spot_column
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.evidence.stores.errors_of_form import bends
from rulec.mismatch.search import limits
from rulec.mismatch.search.evidence import (
    Basis,
    Evidence,
    Noise,
    Point,
    Size,
    Switching,
    Term,
    prior_with_sizes,
    range_over,
    share_of,
    size_of,
    term_with,
)


def forms_of_effects(rows: Rows, seen: NDArray[np.bool_], now: Fitted) -> Array:
    """Each effect's own term times smooth functions of its drivers, shape (rows, functions).

    The driver of a growing fault is its growth so far, as it need not grow linearly. Drivers take
    the values that the model predicts: functions of a reading would explain the noise of that
    reading.
    """
    setting = now.setting
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
        term = _term(now, candidate)
        for shape in shapes:
            column = rows.column(now.maps, {i: v * shape for i, v in term.items()})
            columns.append(column[seen])
    return np.stack(columns, axis=1) if columns else np.zeros((int(seen.sum()), 0))


def _term(now: Fitted, candidate: Candidate) -> dict[int, Array]:
    """Change of each estimate by a candidate, shape (n,), m3/s, by number of the observer."""
    system, setting = now.rows.system, now.setting
    modules = system.reached(candidate.observers)
    there, plain = (
        system.flows(s, at=now.predicted, modules=modules).values
        for s in (setting, setting.leaving(candidate.id))
    )
    return {i: np.nan_to_num(v) for i, v in enumerate(there - plain) if np.any(np.nan_to_num(v))}


def _shapes(driver: Array | float) -> Sequence[Array]:
    values = np.asarray(driver, dtype=float)
    return bends(np.nan_to_num(values, nan=float(np.nanmedian(values))))


def driver_of(system: System, name: str) -> Array:
    """Values of a driver at all points, shape (n,), SI; NaN where it was not read."""
    return system.data.time if name == TIME else system.data.values[name]


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


def term_of(
    geometry: Geometry,
    place: str,
    changed: DisturbanceLocation,
    slopes: Array,
    driver: str,
    basis: Basis | Switching,
) -> Term | None:
    """A term with functions of a driver; None where it does not show.

    `place` is the id of the place; `slopes`, shape (open rows,), are those of the residuals by
    `changed`.
    """
    values = driver_of(geometry.rows.system, driver)
    known = np.nan_to_num(values, nan=float(np.nanmedian(values)))[geometry.point]
    table = slopes[:, None] * basis.at(known)
    return term_with(table, place, changed, driver, basis, slopes)


@dataclass(frozen=True)
class SettledPoint:
    """A fit to settled points, reduced to its open rows, flags `seen` of shape (all rows,)."""

    fitted: Fitted
    seen: NDArray[np.bool_]

    @property
    def setting(self) -> Configuration:
        """The joined candidates and all values."""
        return self.fitted.setting

    @cached_property
    def residual(self) -> Array:
        """Residual, shape (rows,), in units of its noise."""
        return self.fitted.residual[self.seen]

    @cached_property
    def jacobian(self) -> Array:
        """Slopes of the residual, shape (rows, values)."""
        return self.fitted.jacobian[self.seen]


class Geometry(Evidence):
    """What all models of one recording have in common.

    Where laws and sensors are `exact`, laws have no error of form and errors of sensors are
    constant.
    """

    def __init__(self, rows: Rows, *, exact: bool = False) -> None:
        system = rows.system
        self.rows = rows
        self.readings = frozenset(s.id for s in system.ruleset.signals)
        self._sizes: dict[str, Size] = {}
        self.seen = system.data.open[rows.point]
        self.point = rows.point[self.seen]
        prior = prior_of(system, Configuration())
        plain = evaluated(rows, Configuration(), prior, prior.mean, system.data.open)
        self.forms, self.law = self._forms(plain, () if exact else system.builder.laws)
        self.moving = np.zeros((self.count, 0)) if exact else self._moving(plain)
        self.held = self._held(plain)
        self.group: NDArray[np.intp] = np.unique(rows.group[self.seen], return_inverse=True)[1]
        self.rank = np.bincount(self.group).astype(float)
        freedom = limits.STUDENT
        constants = gammaln((freedom + self.rank) / 2) - self.rank / 2 * np.log(freedom)
        self.constant = float(np.sum(constants - gammaln(freedom / 2)))

    usual_noise: Noise = (1.0,)

    @property
    def terms(self) -> int:
        system = self.rows.system
        inputs = [s for s in system.ruleset.signals if s.is_input and s.id in system.data.noise]
        return len(system.builder.spots) * max(len(inputs) + system.data.timed, 1)

    @property
    def noises(self) -> tuple[tuple[float, ...], ...]:
        """Sizes of the noise to try, relative to the expected one."""
        return (limits.NOISE_SCALES,)

    @property
    def count(self) -> int:
        return int(self.seen.sum())

    @property
    def candidates(self) -> Sequence[Candidate]:
        return self.rows.system.candidates

    def prior(self, setting: Configuration) -> Prior:
        plain = prior_of(self.rows.system, setting)
        return prior_with_sizes(plain, setting, self.size, self._range)

    def _range(self, unknown: Unknown, start: float) -> tuple[float, float]:
        data, driver = self.rows.system.data, None
        if unknown.driver is not None:
            driver = data.clock if unknown.driver == TIME else data.values[unknown.driver]
        return range_over(unknown, start, driver)

    def evaluated(self, setting: Configuration, prior: Prior, at: Array) -> SettledPoint:
        used = self.rows.system.data.open
        return SettledPoint(evaluated(self.rows, setting, prior, at, used), self.seen)

    def effect_forms(self, now: Point) -> Array:
        assert isinstance(now, SettledPoint)
        return forms_of_effects(self.rows, self.seen, now.fitted)

    def whitener(self, columns: Array) -> Callable[[Noise], Array]:
        """The columns themselves: their noise is independent."""
        return lambda noise: columns

    def levels(self, noise: Noise, rest: Callable[[], Array], *, alone: bool) -> list[Noise]:
        """The same noise: with all rows weighted alike, large and rare errors show."""
        return [noise]

    def alike(self, noise: Noise) -> Array:
        return np.full(self.count, noise[0] ** -2)

    def noise_odds(self, noise: Noise) -> float:
        return -0.5 * float(np.log(noise[0]) / np.log(limits.NOISE_KNOWN)) ** 2

    def size(self, candidate: Candidate, unknown: Unknown) -> Size:
        if unknown.id not in self._sizes:
            system = self.rows.system
            self._sizes[unknown.id] = size_of(unknown, lambda: share_of(system, candidate, unknown))
        return self._sizes[unknown.id]

    def _forms(
        self, plain: Fitted, laws: Sequence[DisturbanceLocation]
    ) -> tuple[Array, tuple[str, ...]]:
        """Rows of errors of form, shape (rows, errors), and the law of each.

        Each law has its own errors, as large as its accuracy. Two meters in one line share no law:
        no error of form explains a difference between them.
        """
        system = self.rows.system
        flows = system.flows(Configuration())
        columns, law = [np.zeros((self.count, 0))], []
        ways: dict[str, Array] = {}
        for spot in laws:
            column = spot_column(plain, spot)
            if column is None:
                continue
            if spot.module not in ways:
                ways[spot.module] = _smooth_over(
                    likeness(system, flows, spot.module), limits.FORM_RANK
                )
            u = common.FORM_U * spot.accuracy * np.nan_to_num(system.value_of(spot))
            whole = column * u[self.rows.point]
            own = (whole[:, None] * ways[spot.module][self.rows.point])[self.seen]
            left, size, _ = np.linalg.svd(own, full_matrices=False)
            kept = size * limits.FORM_KNOWN > limits.FORM_NOT_SEEN
            columns.append(left[:, kept] * size[kept])
            law += [spot.id] * int(kept.sum())
        return np.concatenate(columns, axis=1), tuple(law)

    def _held(self, plain: Fitted) -> Array:
        """Rows of the errors of inputs that are held over several points, shape (rows, errors)."""
        data = self.rows.system.data
        flows = self.rows.system.flows(Configuration())
        columns = [np.zeros((len(self.rows), 0))]
        for name, slopes in flows.by_reading.items():
            values = data.values[name]
            visit = np.cumsum(np.abs(np.diff(values, prepend=np.nan)) > 1e-9 * np.abs(values))
            longer = np.flatnonzero(np.bincount(visit) > 1)
            if len(longer):
                noise = np.nan_to_num(data.noise[name][self.rows.point])
                shown = self.rows.column(plain.maps, slopes) * noise
                columns.append(shown[:, None] * (visit[self.rows.point, None] == longer))
        return np.asarray(np.concatenate(columns, axis=1)[self.seen])

    def _moving(self, plain: Fitted) -> Array:
        """Rows of sensor errors that move slowly within their class, shape (rows, errors)."""
        system = self.rows.system
        lasting = {ERROR + name for name in system.shared}
        errors = [i for i, name in enumerate(plain.prior.names) if name in lasting]
        if not (system.data.timed and errors):
            return np.zeros((self.count, 0))
        course = _smooth_in_time(system.data.time, system.data.source)[self.point]
        tables = [plain.jacobian[self.seen][:, [i]] * course for i in errors]
        left, size, _ = np.linalg.svd(np.concatenate(tables, axis=1), full_matrices=False)
        kept = size * limits.MOVING_SHARES[-1] > limits.FORM_NOT_SEEN
        return np.asarray(left[:, kept] * size[kept])

    def shown(self, columns: Array) -> dict[str, float]:
        squares: dict[str, float] = {}
        for column in columns.T:
            whole = np.zeros(len(self.rows))
            whole[self.seen] = column
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
        far = np.log1p(square / limits.STUDENT)
        return np.asarray(self.rank * np.log(scale) + 0.5 * (limits.STUDENT + self.rank) * far)

    def expected_weights(self, noise: Noise) -> Array:
        """Mean information of each row, shape (rows,): Fisher information of Student noise."""
        each = (limits.STUDENT + self.rank) / (limits.STUDENT + self.rank + 2.0) / noise[0] ** 2
        return np.asarray(each[self.group])

    def drawn(self, noise: Noise, count: int, rng: np.random.Generator) -> Array:
        """Student noise with one scale for all rows of a group."""
        normal = rng.standard_normal((self.count, count))
        square = rng.chisquare(limits.STUDENT, (len(self.rank), count))
        return np.asarray(noise[0] * normal * np.sqrt(limits.STUDENT / square)[self.group])

    def scored(self, residuals: Array, noise: Noise) -> tuple[Array, Array]:
        far = self._member @ residuals**2 / noise[0] ** 2
        rank = self.rank[:, None]
        each = (limits.STUDENT + rank) / (limits.STUDENT + far) / noise[0] ** 2
        lost = (limits.STUDENT + rank) * np.log1p(far / limits.STUDENT)
        return each[self.group], np.sum(lost, axis=0)

    @cached_property
    def _member(self) -> csr_array:
        """Membership of rows in groups, shape (groups, rows)."""
        at = self.group, np.arange(self.count)
        return csr_array((np.ones(self.count), at), (len(self.rank), self.count))
