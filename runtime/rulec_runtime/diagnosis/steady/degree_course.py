"""The course of a degree: how large one fault was over time, is now, and will be.

A fault that grows by less from stretch to stretch than sensors may drift looks like a drifting
sensor if only neighbours are compared. So all stretches are explained together: lasting errors by
their classes and the calibration, the degree by a course, which begins somewhere, perhaps with a
jump, and then grows along a line that may bend, or in steps, and perhaps ends at once, as by a
repair. Its onset and its bends are unknown; each possibility counts by its evidence.

Source: own derivation, docs/method.md; linear Gaussian models compared by their evidence (MacKay
1992).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.baseline import times_of
from rulec_runtime.diagnosis.steady.contrasts import Contrasts
from rulec_runtime.diagnosis.steady.degree_search import DegreeSearch
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, stacked_test, test_of
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import spread_evenly

Moments = tuple[float, float]
"""A number with its standard uncertainty."""


@dataclass(frozen=True, kw_only=True)
class Course:
    """A degree over time.

    Attributes
    ----------
    fault : its place in the ruleset.
    time, degree, u : shape (points,), s, and the degree there with its standard uncertainty.
    now, rate : degree at the end, and its growth per second, unless it goes in steps.
    ahead : times from the end on, s, with the degree then and its standard uncertainty: (3, times).
    steps : times, s, and sizes of steps, if these explain it better than growth does.
    onset, ended : places among the points: where it begins, and the first without it.
    evidence : log-likelihood, exceeding that of a sound plant by `gain`.
    left : chi-square left.
    """

    fault: int
    time: Array
    degree: Array
    u: Array
    now: Moments
    rate: Moments
    ahead: Array
    steps: tuple[Moments, ...]
    onset: int
    ended: int
    evidence: float
    gain: float
    left: float

    @property
    def grows(self) -> bool:
        """Whether growth explains it, and no steps."""
        return not self.steps


@dataclass(frozen=True, kw_only=True)
class Shapes:
    """Possible courses of a degree over some points, and their prior probabilities.

    Attributes
    ----------
    time : shape (points,), s; `end`, s, is when the last stretch ends.
    ended : time, s, from which on the degree is 0.
    columns : components of a course, shape (courses, parts), by their places among the columns of
        `table`.
    spread : their standard deviations, shape (courses, parts); `prior` the logarithms of
        probabilities, shape (courses,).
    constant : whether it is a single jump without growth, shape (courses,).
    """

    time: Array
    end: float
    ended: float
    columns: np.ndarray
    spread: Array
    prior: Array
    constant: np.ndarray

    def table(self, time: Array) -> Array:
        """Jumps, ramps and curves from each point, at some times, s, shape (times, 3 * points)."""
        whole = self.time[-1] - self.time[0]
        since = np.maximum((time[:, None] - self.time) / whole, 0.0)
        begun = (time[:, None] >= self.time).astype(float)
        return np.where(time[:, None] < self.ended, np.hstack([begun, since, since**2]), 0.0)

    def rates(self) -> Array:
        """Growth of each column per second at the end, shape (3 * points,)."""
        whole = float(self.time[-1] - self.time[0])
        since = np.maximum((self.end - self.time) / whole, 0.0)
        return np.concatenate([0.0 * since, since > 0.0, 2.0 * since]) / whole


def shapes_of(time: Array, end: float, ended: int, onsets: np.ndarray, scale: float) -> Shapes:
    """Courses that begin at some points and are over at point `ended`, of a degree with typical
    size `scale`."""
    count, knots = len(time), limits.BENDS_OF_A_COURSE
    over, repaired = np.inf, 0.0
    if ended < count:
        end, over, repaired = float(time[ended - 1]), float(time[ended]), -float(np.log(count))
        onsets = onsets[onsets < ended]
    rows: list[tuple[list[int], list[float], float, bool]] = []
    for onset in onsets.tolist():
        where = repaired + (limits.FAULT_FROM_START if onset == 0 else -np.log(len(onsets)))
        bent = np.linspace(onset, ended - 1, knots + 1).round().astype(int)[:-1]
        parts = [onset, count + onset, *(2 * count + bent)]
        rows.append((parts, [scale, *[0.0] * (knots + 1)], where - np.log(2.0), True))
        behind = ended - onset
        if behind < limits.POINTS_THAT_GROW:
            continue
        whole = float((time[-1] - time[0]) / (time[ended - 1] - time[onset]))
        # With as many bends as points a course would pass through all of them.
        free = np.arange(knots) % (1 + 4 * knots // behind) == 0
        ways = [(jump, bend) for jump in (0.0, scale) for bend in limits.BENDING]
        for jump, bend in ways:
            curved = bend * scale * whole**2 * free
            chance = where - np.log(2.0 * len(ways))
            rows.append((parts, [jump, scale * whole, *curved], chance, False))
    at, spreads, prior, constant = map(np.array, zip(*rows, strict=True))
    return Shapes(
        time=time,
        end=end,
        ended=over,
        columns=at,
        spread=spreads,
        prior=prior,
        constant=constant,
    )


class _Weighed(NamedTuple):
    """Posterior of each course: its columns and their sizes, shape (courses, parts), with their
    covariance; log-likelihood gained over no fault plus log prior, shape (courses,)."""

    columns: np.ndarray
    parts: Array
    covariance: Array
    gain: Array

    def moments(self, rows: Array) -> tuple[Array, Array]:
        """Mean over all courses, and standard uncertainty, of numbers that are linear in the
        columns: `rows` of shape (numbers, columns); both of shape (numbers,)."""
        weight = np.exp(self.gain - _any_of(self.gain))
        likely = np.flatnonzero(weight > limits.IMPROBABLE)
        share = weight[likely] / weight[likely].sum()
        own = rows[:, self.columns[likely]].transpose(1, 0, 2)
        mean = (own @ self.parts[likely, :, None])[:, :, 0]
        middle = share @ mean
        within = np.sum(own @ self.covariance[likely] * own, axis=2)
        u: Array = np.sqrt(np.maximum(share @ (within + (mean - middle) ** 2), 0.0))
        return middle, u


def _any_of(gain: Array) -> float:
    """Log-likelihood gained by any of some courses."""
    return float(np.logaddexp.reduce(gain, initial=-np.inf))


class _Equations(NamedTuple):
    """Normal equations of all columns of a course."""

    gram: Array
    pull: Array

    def compared(self, at: np.ndarray, spread: Array, prior: Array) -> _Weighed:
        """Courses of some columns, shape (courses, parts), with the spread of each part."""
        scale = spread[:, :, None] * spread[:, None, :]
        own = self.gram[at[:, :, None], at[:, None, :]] * scale + np.eye(at.shape[1])
        inverse, pulled = np.linalg.inv(own), self.pull[at] * spread
        scaled = np.einsum("cij,cj->ci", inverse, pulled)
        fitted = np.einsum("ci,ci->c", pulled, scaled)
        gain = 0.5 * (fitted - np.linalg.slogdet(own)[1]) + prior
        return _Weighed(at, scaled * spread, inverse * scale, gain)

    def by_steps(self, count: int, scale: float) -> _Weighed:
        """The best few steps of typical size `scale`, one found after the other, at so many
        points."""
        chosen: list[int] = []
        best: _Weighed | None = None
        for _ in range(min(limits.STEPS_OF_A_COURSE, max(count // limits.POINTS_OF_A_STEP, 1))):
            tried = np.array([[*chosen, k] for k in range(count) if k not in chosen])
            prior = np.full(len(tried), -(len(chosen) + 1) * np.log(count))
            found = self.compared(tried, np.full(tried.shape, scale), prior)
            most = int(np.argmax(found.gain))
            if best is not None and found.gain[most] <= best.gain[0]:
                break
            chosen.append(int(tried[most, -1]))
            best = _Weighed(*(table[[most]] for table in found))
        assert best is not None
        return best


def _growing(shapes: Shapes, slopes: Array, residuals: Array) -> tuple[_Equations, _Weighed]:
    """Courses that grow, by white residuals, shape (m,), and their slopes by the degree at each
    point, shape (m, points)."""
    moved = slopes @ shapes.table(shapes.time)
    equations = _Equations(moved.T @ moved, -(moved.T @ residuals))
    return equations, equations.compared(shapes.columns, shapes.spread, shapes.prior)


def _weighed(
    shapes: Shapes, slopes: Array, residuals: Array
) -> tuple[_Weighed, _Weighed, tuple[Moments, ...]]:
    """Courses that grow, and what explains more: these, or the best few steps, which follow by
    times, s, and sizes. Growth must explain much more than steps do."""
    equations, growing = _growing(shapes, slopes, residuals)
    steps = equations.by_steps(len(shapes.time), float(shapes.spread[0].max()))
    grown, constant = (_any_of(growing.gain[x]) for x in (~shapes.constant, shapes.constant))
    if grown > max(constant, float(steps.gain[0])) + limits.GROWS:
        return growing, growing, ()
    pairs = zip(steps.columns[0].tolist(), steps.parts[0].tolist(), strict=True)
    return growing, steps, tuple((float(shapes.time[k]), size) for k, size in sorted(pairs))


@dataclass(frozen=True, kw_only=True)
class Stack:
    """Stretches of a part in order of time, all of which one course has to explain.

    `test` is one problem of them; `time` shape (points,), s; `end` is when the last one ends;
    `shown` are the faults that its residuals were chosen for, None if they are all residuals.
    """

    test: HypothesisTest
    time: Array
    end: float
    shown: tuple[int, ...] | None

    @property
    def points(self) -> np.ndarray:
        """The stretches, by their places among all, shape (points,)."""
        return np.asarray(self.test.members[:, 0])

    @cached_property
    def sound(self) -> tuple[Array, Array]:
        """Whitened residuals, shape (m,), and the whitening matrix, shape (m, m)."""
        white = _whitener(self.test.covariance()[0])
        assert white is not None, "checked when the stack was made"
        return white @ self.test.residuals[0], white

    @cached_property
    def repaired(self) -> int:
        """The point that differs most from what those before it predict."""
        each = self.sound[0].reshape(len(self.time), -1)
        first = limits.POINTS_THAT_GROW
        return first + int(np.argmax(np.sum(each[first:] ** 2, axis=1))) if len(each) > first else 0

    def ends(self) -> tuple[int, ...]:
        """First points without a fault that are tried: after the last, and where it may have been
        repaired."""
        return (len(self.time), self.repaired) if self.repaired else (len(self.time),)

    def gain_at_first(self, fault: int) -> float:
        """Log-likelihood gain over a sound plant, to first order; -inf if no estimate shows the
        fault."""
        residuals, white = self.sound
        slopes = self._in_columns(self.test.effects([fault])[0, :, 0])
        if not slopes.any():
            return -np.inf
        few = np.arange(0, len(self.time), limits.ONSETS_AT_FIRST)
        every = (self.shapes(fault, few, ended) for ended in self.ends())
        return max(_any_of(_growing(s, white @ slopes, residuals)[1].gain) for s in every)

    def shapes(self, fault: int, onsets: np.ndarray, ended: int) -> Shapes:
        """Possible courses of the degree of a fault that begin at some points."""
        usual = limits.USUAL_DEGREE * self.test.ruleset.faults[fault].scale
        return shapes_of(self.time, self.end, ended, onsets, usual)

    def course(
        self, fault: int, onsets: np.ndarray | None = None, ended: int | None = None
    ) -> Course | None:
        """The course that explains most, over at point `ended`; None if no credible one exists."""
        spec, time = self.test.ruleset.faults[fault], self.time
        ended, begun = ended or len(time), np.arange(0, len(time), 2) if onsets is None else onsets
        shapes = self.shapes(fault, begun, ended)
        table, degree = shapes.table(time), np.zeros(len(time))
        for _ in range(limits.FIT_STEPS):
            if (undone := self._undone(fault, degree)) is None:
                return None
            residuals, slopes, white = undone
            without = white @ (residuals - slopes @ degree)
            growing, weighed, steps = _weighed(shapes, white @ slopes, without)
            mean, u = weighed.moments(table)
            before, degree = degree, np.clip(mean, spec.lowest, spec.credible)
            if np.max(np.abs(degree - before)) < limits.COURSE_CONVERGED * spec.scale:
                break
        # How well it explains the stretches counts with the tolerance of the law.
        if (undone := self._undone(fault, degree, lenient=True)) is None:
            return None
        residuals, slopes, white = undone
        left = float(np.sum((white @ residuals) ** 2))
        without = white @ (residuals - slopes @ degree)
        _, lenient, _ = _weighed(shapes, white @ slopes, without)
        evidence = self._volume(fault, degree) - 0.5 * float(without @ without)
        evidence += _any_of(lenient.gain)
        (now,), (u_now,) = weighed.moments(shapes.table(np.array([shapes.end])))
        (rate,), (u_rate,) = growing.moments(shapes.rates()[None])
        lowest = np.append(mean + common.COVERAGE * u, now + common.COVERAGE * u_now).min()
        if not (lowest >= spec.lowest and max(now, mean.max()) < spec.credible):
            return None
        onset = int(weighed.columns[int(np.argmax(weighed.gain))].min())
        if steps:
            # The first significant one; an initial level near 0 is none.
            least = common.COVERAGE * np.sqrt(np.diag(weighed.covariance[0]))
            sure = np.abs(weighed.parts[0]) > least
            onset = int(weighed.columns[0][sure if sure.any() else slice(None)].min())
        ahead = np.geomspace(limits.SOONEST, limits.LATEST, limits.TIMES_AHEAD)
        later = shapes.end + (shapes.end - time[min(onset, ended - 2)]) * ahead
        then, u_then = weighed.moments(shapes.table(later))
        wide = max(left / len(residuals), 1.0) ** 0.5
        return Course(
            fault=fault,
            time=time,
            degree=mean,
            u=wide * u,
            now=(float(now), wide * float(u_now)),
            rate=(float(rate), wide * float(u_rate)),
            ahead=np.stack([later, then, wide * u_then]),
            steps=steps,
            onset=onset,
            ended=ended,
            evidence=evidence,
            gain=evidence + 0.5 * float(np.sum(self.sound[0] ** 2)),
            left=left,
        )

    def _search(self, fault: int, degree: Array) -> DegreeSearch:
        """The fault with a degree at each point, in units of these."""
        faults, here = (self.test.ruleset.faults[fault],), replace(self.test, computed=None)
        here = replace(here, present=degree[:, None])
        return DegreeSearch(test=here, faults=faults, touched=here.touched(faults))

    def _volume(self, fault: int, degree: Array) -> float:
        """Log-likelihood by the volume of the errors, over that of a sound plant.

        Undoing scales the readings, and so their density. A fault of the plant scales its errors
        alike, and nothing is left; systematic errors of a faulty sensor are those of a sound one.
        """
        scales = self._search(fault, degree).scales(np.ones((1, 1)))
        if not scales.sensors:
            return 0.0
        each = replace(scales, sensors=()), scales
        alike, own = (np.linalg.slogdet(self.test.covariance(s)[0])[1] for s in each)
        return 0.5 * float(alike - own)

    def _undone(
        self, fault: int, degree: Array, *, lenient: bool = False
    ) -> tuple[Array, Array, Array] | None:
        """Residuals with the fault undone, their slopes by the degree at each point, and the
        whitening matrix; `lenient`: with the tolerance of its law. None if the law has no value
        there, or no estimate shows the fault."""
        spec, test = self.test.ruleset.faults[fault], self.test
        if not test.touched((spec,)):
            return None
        search = self._search(fault, degree)
        moved, slopes = search.moved_and_slopes(degree[None, :, None])
        own = test.basis[:, search.rows]
        residuals = test.residuals[0] + (own @ moved[:, :, 0]).T.ravel()
        table = self._in_columns((own @ slopes[:, 0, :, 0]).T.ravel())
        covariance = test.covariance(search.scales(np.ones((1, 1))))[0]
        if lenient:
            for row, column in zip(moved[:, :, 0], own.T, strict=True):
                off = spec.tolerance * np.outer(row, column).ravel()
                covariance = covariance + np.outer(off, off)
        white = _whitener(covariance)
        if white is None or not (np.isfinite(residuals).all() and np.isfinite(table).all()):
            return None
        return residuals, table, white

    def _in_columns(self, slopes: Array) -> Array:
        """Slopes of the residuals of each point, shape (m,), by the degree at each point."""
        count = len(self.time)
        table = np.zeros((count, len(slopes) // count, count))
        table[np.arange(count), :, np.arange(count)] = slopes.reshape(count, -1)
        return table.reshape(-1, count)


def stack_of(
    ruleset: Ruleset, observed: Observed, points: np.ndarray, end: float, named: list[int]
) -> Stack | None:
    """Points of a part stacked, thinned if many; None if they are too few. For a large part only
    the combinations that show the `named` faults."""
    if len(points) < limits.POINTS_THAT_GROW:
        return None
    members, valid = spread_evenly(observed.valid, points, limits.POINTS_OF_A_COURSE)
    time, present = times_of(observed)[members], np.ones((len(members), 1))
    if len(members) < limits.POINTS_THAT_GROW or not np.all(np.diff(time) > 0.0):
        return None
    test = stacked_test(ruleset, observed, valid, members[:, None], present, limits.DRIFT_TIMES)
    few = len(test.basis) >= limits.MANY_RESIDUALS
    if few:
        one = test_of(ruleset, observed, valid, members[len(members) // 2 :][:1])
        some, shown = Contrasts(one, len(members)).basis(named)
        if not shown:
            return None
        test = test.in_basis(some)
    # For readings beyond all limits, rounding hides the errors.
    sound = len(test.basis) and _whitener(test.covariance()[0]) is not None
    if not sound or not np.isfinite(test.residuals).all():
        return None
    faults = tuple(named) if few else None
    return Stack(test=test, time=time, end=max(end, float(time[-1])), shown=faults)


def _whitener(covariance: Array) -> Array | None:
    """Whitening matrix of a covariance, shape (m, m); None if there is none."""
    ridge = limits.RIDGE * float(np.trace(covariance))
    try:
        root = np.linalg.cholesky(covariance + ridge * np.eye(len(covariance)))
        white: Array = np.linalg.inv(root)
    except np.linalg.LinAlgError:
        return None
    return white if np.isfinite(white).all() else None
