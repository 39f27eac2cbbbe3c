"""The course of a degree: how large one fault was over time, is now, and will be.

A fault that grows by less from stretch to stretch than sensors may drift looks like a drifting
sensor if only neighbours are compared. So all stretches are explained together: lasting errors by
their classes and the calibration, the degree by a course, which begins somewhere, perhaps with a
jump, and then grows along a line that may bend, or in steps. Its onset and its bends are unknown;
each possibility counts by its evidence.

Source: own derivation, docs/method.md; linear Gaussian models compared by their evidence (MacKay
1992).
"""

from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.baseline import times_of
from rulec_runtime.diagnosis.steady.contrasts import Contrasts
from rulec_runtime.diagnosis.steady.degree_search import Trial
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest
from rulec_runtime.diagnosis.steady.isolate import test_of
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import residual_basis
from rulec_runtime.diagnosis.steady.stacked_stretches import spread_evenly, stacked_test

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
    onset : place among the points where it begins.
    evidence : log-likelihood, exceeding that of a sound plant by `gain`.
    left : chi-square left, with so many residuals.
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
    evidence: float
    gain: float
    left: float
    residuals: int

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
    columns : components of a course, shape (courses, parts), by their places among the columns of
        `table`.
    spread : their standard deviations, shape (courses, parts); `prior` the logarithms of
        probabilities, shape (courses,).
    constant : whether it is a single jump without growth, shape (courses,).
    """

    time: Array
    end: float
    columns: np.ndarray
    spread: Array
    prior: Array
    constant: np.ndarray

    def table(self, time: Array) -> Array:
        """Jumps, ramps and curves from each point, at some times, s, shape (times, 3 * points)."""
        whole = self.time[-1] - self.time[0]
        since = np.maximum((time[:, None] - self.time) / whole, 0.0)
        begun = (time[:, None] >= self.time).astype(float)
        return np.hstack([begun, since, since**2])

    def rates(self) -> Array:
        """Growth of each column per second at the end, shape (3 * points,)."""
        whole = float(self.time[-1] - self.time[0])
        since = np.maximum((self.end - self.time) / whole, 0.0)
        return np.concatenate([0.0 * since, since > 0.0, 2.0 * since]) / whole


def shapes_of(time: Array, end: float, onsets: np.ndarray, scale: float) -> Shapes:
    """Courses that begin at some points, of a degree with typical size `scale`."""
    count, knots = len(time), limits.BENDS_OF_A_COURSE
    rows: list[tuple[list[int], list[float], float, bool]] = []
    for onset in onsets.tolist():
        where = limits.FAULT_FROM_START if onset == 0 else -np.log(len(onsets))
        bent = np.linspace(onset, count - 1, knots + 1).round().astype(int)[:-1]
        parts = [onset, count + onset, *(2 * count + bent)]
        rows.append((parts, [scale, *[0.0] * (knots + 1)], where - np.log(2.0), True))
        behind = count - onset
        if behind < limits.POINTS_THAT_GROW:
            continue
        whole = float((time[-1] - time[0]) / (time[-1] - time[onset]))
        # With as many bends as points a course would pass through all of them.
        free = np.arange(knots) % (1 + 4 * knots // behind) == 0
        ways = [(jump, bend) for jump in (0.0, scale) for bend in limits.BENDING]
        for jump, bend in ways:
            curved = bend * scale * whole**2 * free
            chance = where - np.log(2.0 * len(ways))
            rows.append((parts, [jump, scale * whole, *curved], chance, False))
    at, spreads, prior, constant = map(np.array, zip(*rows, strict=True))
    return Shapes(time=time, end=end, columns=at, spread=spreads, prior=prior, constant=constant)


@dataclass(frozen=True, kw_only=True)
class _Weighed:
    """Posterior of each course.

    Attributes
    ----------
    columns, parts, covariance : per course its columns and their sizes, shape (courses, parts),
        with their covariance.
    gain : log-likelihood gained over no fault plus log prior, shape (courses,).
    left : chi-square left by each, shape (courses,).
    """

    columns: np.ndarray
    parts: Array
    covariance: Array
    gain: Array
    left: Array

    @property
    def total(self) -> float:
        """Log-likelihood gained by any of the courses."""
        return _log_sum(self.gain)

    @property
    def weight(self) -> Array:
        """Probabilities of the courses, shape (courses,)."""
        return np.asarray(np.exp(self.gain - self.total))

    def moments(self, rows: Array) -> tuple[Array, Array]:
        """Mean over all courses, and standard uncertainty, of numbers that are linear in the
        columns: `rows` of shape (numbers, columns); both of shape (numbers,)."""
        likely = np.flatnonzero(self.weight > limits.IMPROBABLE)
        share = self.weight[likely] / self.weight[likely].sum()
        own = rows[:, self.columns[likely]].transpose(1, 0, 2)
        mean = (own @ self.parts[likely, :, None])[:, :, 0]
        middle = share @ mean
        within = np.sum(own @ self.covariance[likely] * own, axis=2)
        u: Array = np.sqrt(np.maximum(share @ (within + (mean - middle) ** 2), 0.0))
        return middle, u


def _weighed(
    shapes: Shapes, slopes: Array, residuals: Array, *, steps: bool = True
) -> tuple[_Weighed, _Weighed | None]:
    """Courses that grow, and the best few steps, compared by white residuals, shape (m,), and their
    slopes by the degree at each point, shape (m, points)."""
    moved = slopes @ shapes.table(shapes.time)
    gram, pull = moved.T @ moved, -(moved.T @ residuals)
    whole = float(residuals @ residuals)
    every = _compared(gram, pull, whole, shapes.columns, shapes.spread, shapes.prior)
    if not steps:
        return every, None
    return every, _by_steps(gram, pull, whole, len(shapes.time), float(shapes.spread[0].max()))


def _compared(
    gram: Array, pull: Array, whole: float, at: np.ndarray, spread: Array, prior: Array
) -> _Weighed:
    own = gram[at[:, :, None], at[:, None, :]] * spread[:, :, None] * spread[:, None, :]
    pulled, one = pull[at] * spread, np.eye(at.shape[1])
    inverse = np.linalg.inv(own + one)
    scaled = np.einsum("cij,cj->ci", inverse, pulled)
    fitted = np.einsum("ci,ci->c", pulled, scaled)
    return _Weighed(
        columns=at,
        parts=scaled * spread,
        covariance=inverse * spread[:, :, None] * spread[:, None, :],
        gain=0.5 * (fitted - np.linalg.slogdet(own + one)[1]) + prior,
        left=whole - 2.0 * fitted + np.einsum("ci,cij,cj->c", scaled, own, scaled),
    )


def _by_steps(gram: Array, pull: Array, whole: float, count: int, scale: float) -> _Weighed:
    """The best few steps of typical size `scale`, found one after the other, at so many points."""
    chosen: list[int] = []
    best: _Weighed | None = None
    most_steps = min(limits.STEPS_OF_A_COURSE, max(count // limits.POINTS_OF_A_STEP, 1))
    while len(chosen) < most_steps:
        tried = np.array([[*chosen, k] for k in range(count) if k not in chosen])
        prior = np.full(len(tried), -(len(chosen) + 1) * np.log(count))
        found = _compared(gram, pull, whole, tried, np.full(tried.shape, scale), prior)
        most = int(np.argmax(found.gain))
        if best is not None and found.gain[most] <= best.gain[0]:
            break
        chosen.append(int(tried[most, -1]))
        best = _Weighed(**{f.name: getattr(found, f.name)[[most]] for f in fields(found)})
    assert best is not None
    return best


@dataclass(frozen=True, kw_only=True)
class Stack:
    """Stretches of a part in order of time, all of which one course has to explain.

    `test` is one problem of them; `time` shape (points,), s; `end` is when the last one ends.
    """

    test: HypothesisTest
    time: Array
    end: float
    known: dict[tuple[float, bytes], Shapes] = field(default_factory=dict)

    @property
    def points(self) -> np.ndarray:
        """The stretches, by their places among all, shape (points,)."""
        return np.asarray(self.test.members[:, 0])

    @cached_property
    def sound(self) -> tuple[Array, Array]:
        """Whitened residuals, shape (m,), and the whitening matrix, shape (m, m)."""
        white = _whitener(self.test.spread.whole(self.test.members, None)[0])
        assert white is not None, "checked when the stack was made"
        return white @ self.test.residuals[0], white

    def gain_at_first(self, fault: int) -> float:
        """Log-likelihood gain over a sound plant, to first order; -inf if no estimate shows the
        fault."""
        residuals, white = self.sound
        slopes = self._in_columns(self.test.effects([fault])[0, :, 0])
        if not slopes.any():
            return -np.inf
        few = np.arange(0, len(self.time), limits.ONSETS_AT_FIRST)
        every, _ = _weighed(self.shapes(fault, few), white @ slopes, residuals, steps=False)
        return every.total

    def shapes(self, fault: int, onsets: np.ndarray | None = None) -> Shapes:
        """Possible courses of the degree of a fault."""
        spec = self.test.ruleset.faults[fault]
        every = np.arange(0, len(self.time), 2) if onsets is None else onsets
        key = spec.scale, every.tobytes()
        if key not in self.known:
            usual = limits.USUAL_DEGREE * spec.scale
            self.known[key] = shapes_of(self.time, self.end, every, usual)
        return self.known[key]

    def course(self, fault: int, onsets: np.ndarray | None = None) -> Course | None:
        """The course that explains most; None if no credible one exists."""
        spec, shapes = self.test.ruleset.faults[fault], self.shapes(fault, onsets)
        table = shapes.table(self.time)
        degree = np.zeros(len(self.time))
        for _ in range(limits.FIT_STEPS):
            if (undone := self._undone(fault, degree)) is None:
                return None
            residuals, slopes, white = undone
            growing, steps = _weighed(shapes, white @ slopes, white @ (residuals - slopes @ degree))
            weighed = _better(shapes, growing, steps)
            mean, u = weighed.moments(table)
            before, degree = degree, np.clip(mean, spec.lowest, spec.credible)
            if np.max(np.abs(degree - before)) < limits.COURSE_CONVERGED * spec.scale:
                break
        if (rest := self._left(fault, degree, shapes)) is None:
            return None
        left, evidence, count = rest
        wide = max(left / count, 1.0) ** 0.5
        (now,), (u_now,) = weighed.moments(shapes.table(np.array([self.end])))
        (rate,), (u_rate,) = growing.moments(shapes.rates()[None])
        lowest = np.append(mean + common.COVERAGE * u, now + common.COVERAGE * u_now).min()
        if not (lowest >= spec.lowest and max(now, mean.max()) < spec.credible):
            return None
        onset = int(weighed.columns[int(np.argmax(weighed.gain))].min())
        in_order: tuple[Moments, ...] = ()
        if weighed is steps:
            in_order, onset = _steps_in_order(self.time, weighed), _first_step(weighed)
        later = self.end + (self.end - self.time[min(onset, len(self.time) - 2)]) * _AHEAD
        ahead, u_ahead = weighed.moments(shapes.table(later))
        return Course(
            fault=fault,
            time=self.time,
            degree=mean,
            u=wide * u,
            now=(float(now), wide * float(u_now)),
            rate=(float(rate), wide * float(u_rate)),
            ahead=np.stack([later, ahead, wide * u_ahead]),
            steps=in_order,
            onset=onset,
            evidence=evidence,
            gain=evidence - _log_density(*self.sound),
            left=left,
            residuals=count,
        )

    def _undone(
        self, fault: int, degree: Array, *, lenient: bool = False
    ) -> tuple[Array, Array, Array] | None:
        """Residuals with the fault undone, their slopes by the degree at each point, and the
        whitening matrix; `lenient`: with the tolerance of its law. None if the law has no value
        there."""
        spec, basis = self.test.ruleset.faults[fault], self.test.basis
        names = self.test.touched((spec,))
        here = replace(self.test, present=degree[:, None], known=None)
        trial = Trial(test=here, faults=(spec,), touched=names)
        moved, slopes = trial.moved_and_slopes(degree[None, :, None])
        places = trial.places
        own = basis[:, places]
        residuals = self.test.residuals[0] + (own @ moved[:, :, 0]).T.ravel()
        table = self._in_columns((own @ slopes[:, 0, :, 0]).T.ravel())
        scales = trial.scales(np.ones((1, 1)))
        covariance = self.test.spread.whole(self.test.members, scales)[0]
        if lenient:
            for row, place in enumerate(places):
                off = spec.tolerance * (moved[row, :, 0][:, None] * basis[:, place]).ravel()
                covariance = covariance + np.outer(off, off)
        white = _whitener(covariance)
        if white is None or not (np.isfinite(residuals).all() and np.isfinite(table).all()):
            return None
        return residuals, table, white

    def _left(self, fault: int, degree: Array, shapes: Shapes) -> tuple[float, float, int] | None:
        """Chi-square and log-likelihood with the tolerance of the law, and number of residuals."""
        if (undone := self._undone(fault, degree, lenient=True)) is None:
            return None
        residuals, slopes, white = undone
        without = white @ (residuals - slopes @ degree)
        weighed = _better(shapes, *_weighed(shapes, white @ slopes, without))
        evidence = _log_density(without, white) + weighed.total
        return float(np.sum((white @ residuals) ** 2)), evidence, len(residuals)

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
    members, valid = spread_evenly(observed, points, limits.POINTS_OF_A_COURSE)
    basis = residual_basis(ruleset, valid)
    if len(members) < limits.POINTS_THAT_GROW or not len(basis):
        return None
    time = times_of(observed)[members]
    if not np.all(np.diff(time) > 0.0):
        return None
    test = stacked_test(
        ruleset,
        observed,
        valid,
        members[:, None],
        np.ones((len(members), 1)),
        wanders=limits.WANDERS,
    )
    if len(basis) >= limits.MANY_RESIDUALS:
        if not named:
            return None
        one = test_of(ruleset, observed, valid, basis, members[len(members) // 2 :][:1])
        some, shown = Contrasts(one, len(members)).basis(named)
        if not shown:
            return None
        test = test.seen_by(some)
    # For readings beyond all limits, rounding hides the errors.
    if _whitener(test.spread.whole(test.members, None)[0]) is None:
        return None
    if not np.isfinite(test.residuals).all():
        return None
    return Stack(test=test, time=time, end=max(end, float(time[-1])))


def _whitener(covariance: Array) -> Array | None:
    """Whitening matrix of a covariance, shape (m, m); None if there is none."""
    ridge = limits.RIDGE * float(np.trace(covariance))
    try:
        root = np.linalg.cholesky(covariance + ridge * np.eye(len(covariance)))
        white: Array = np.linalg.inv(root)
    except np.linalg.LinAlgError:
        return None
    return white if np.isfinite(white).all() else None


def _log_density(residuals: Array, white: Array) -> float:
    """Logarithm of the density of white residuals, shape (m,), up to a constant."""
    return float(np.sum(np.log(np.diag(white)))) - 0.5 * float(residuals @ residuals)


def _log_sum(values: Array) -> float:
    top = float(np.max(values, initial=-np.inf))
    return top + float(np.log(np.sum(np.exp(values - top)))) if np.isfinite(top) else -np.inf


def _better(shapes: Shapes, growing: _Weighed, steps: _Weighed | None) -> _Weighed:
    """Growth, if it explains much more than steps do; else these."""
    grown = _log_sum(growing.gain[~shapes.constant])
    constant = _log_sum(growing.gain[shapes.constant])
    if steps is None or grown > max(constant, steps.total) + limits.GROWS:
        return growing
    return steps


_AHEAD = np.geomspace(limits.SOONEST, limits.LATEST, limits.TIMES_AHEAD)


def _first_step(weighed: _Weighed) -> int:
    """The point of the first significant step; an initial level near 0 is none."""
    u = np.sqrt(np.diag(weighed.covariance[0]))
    sure = np.abs(weighed.parts[0]) > common.COVERAGE * u
    return int(weighed.columns[0][sure if sure.any() else slice(None)].min())


def _steps_in_order(time: Array, weighed: _Weighed) -> tuple[Moments, ...]:
    pairs = zip(weighed.columns[0].tolist(), weighed.parts[0].tolist(), strict=True)
    return tuple((float(time[k]), size) for k, size in sorted(pairs))
