"""The course of a degree: how large one fault was over time, is now, and where it is going.

A fault that grows by less from stretch to stretch than sensors may wander looks like a wandering
sensor to whoever compares neighbours. So all stretches are explained together: errors that last by
their classes and the calibration, the degree by a course, which begins somewhere, perhaps with a
jump, and then grows along a line that may bend. When it begins and how far it bends nobody knows;
each possibility counts by its evidence.

Source: own derivation, docs/method.md; linear Gaussian models compared by their evidence (MacKay
1992), a cubic-spline prior of the course (Wahba 1978) in pieces of straight lines.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.baseline import times_of
from rulec_runtime.diagnosis.steady.columns import Columns
from rulec_runtime.diagnosis.steady.contrasts import Contrasts
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest
from rulec_runtime.diagnosis.steady.isolate import test_of
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import residual_basis
from rulec_runtime.diagnosis.steady.stack import spread_evenly, stacked_test


@dataclass(frozen=True, kw_only=True)
class Course:
    """A degree over time.

    Attributes
    ----------
    fault : its place in the ruleset.
    time, degree, u : shape (points,), s, and the degree there with its standard uncertainty.
    now, rate : degree at the end with its standard uncertainty, and its growth per second.
    bend : variance by which the rate changes per second, 1/s3; `shared` covariance of now and rate.
    onset : place among the points where it begins.
    evidence : log-likelihood, a sound plant's less than `gain`; `grown` is by how much growth
        explains more than steps do. `left` is chi-square that it leaves, with so many residuals.
    """

    fault: int
    time: Array
    degree: Array
    u: Array
    now: tuple[float, float]
    rate: tuple[float, float]
    shared: float
    bend: float
    onset: int
    evidence: float
    gain: float
    grown: float
    left: float
    residuals: int


@dataclass(frozen=True, kw_only=True)
class Shapes:
    """Courses that a degree may take over some points, and how likely each is beforehand.

    `table` are jumps and ramps that begin at each point, shape (points, 2 * points), `columns`
    those that a course is made of, shape (courses, parts), `spread` their standard deviations,
    `prior` the logarithms of probabilities, `onsets` where each begins, `steps` whether it does not
    grow. `bends` are variances of the change of the rate per second, per squared unit of degree.
    """

    time: Array
    table: Array
    columns: np.ndarray
    spread: Array
    prior: Array
    onsets: np.ndarray
    steps: np.ndarray
    bends: Array


def shapes_of(time: Array, onsets: np.ndarray, scale: float) -> Shapes:
    """Courses that begin at some points, of a degree of which sizes like `scale` are usual."""
    count, whole = len(time), float(time[-1] - time[0])
    since = time[:, None] - time
    table = np.hstack([(since >= 0.0).astype(float), np.maximum(since, 0.0) / whole])
    rows: list[tuple[list[int], list[float], float, int, bool, float]] = []
    blank = [0.0] * limits.BENDS_OF_A_COURSE
    at_start = limits.FAULT_FROM_START
    for onset in onsets.tolist():
        where = at_start if onset == 0 else -np.log(len(onsets))
        constant = [onset, count + onset, *(count + onset for _ in blank)]
        rows.append((constant, [scale, 0.0, *blank], where - np.log(2.0), onset, True, 0.0))
        behind = count - onset
        if behind < limits.POINTS_THAT_GROW:
            continue
        lasts = float(time[-1] - time[onset])
        knots = np.linspace(onset, count - 1, len(blank) + 2).round().astype(int)[1:-1]
        parts = [onset, count + onset, *(count + knots)]
        steep = scale * whole / lasts
        # A course that bends as often as there are points would go through all of them.
        free = np.arange(len(blank)) % (1 + limits.BENDS_OF_A_COURSE * 4 // behind) == 0
        ways = [(jump, bend) for jump in (0.0, scale) for bend in limits.BENDING]
        for jump, bend in ways:
            one = bend * steep / np.sqrt(free.sum())
            chance = where - np.log(2.0 * len(ways))
            spread = [jump, steep, *(one * free)]
            rows.append((parts, spread, chance, onset, False, (bend / lasts) ** 2 / lasts))
    at, spreads, prior, begin, steps, bends = map(np.array, zip(*rows, strict=True))
    return Shapes(
        time=time,
        table=table,
        columns=at,
        spread=spreads,
        prior=prior,
        onsets=begin,
        steps=steps,
        bends=bends * scale**2,
    )


@dataclass(frozen=True, kw_only=True)
class _Weighed:
    """What readings say of each course: parts, shape (courses, parts), with their covariance, the
    log-likelihood gained over no fault, shape (courses,), that gained by steps alone, and
    chi-square left by each course."""

    parts: Array
    covariance: Array
    gain: Array
    steps: float
    left: Array


def _weighed(shapes: Shapes, slopes: Array, residuals: Array) -> _Weighed:
    """Courses compared by white residuals, shape (m,), and their slopes by the degree at each
    point, shape (m, points)."""
    moved = slopes @ shapes.table
    gram, pull = moved.T @ moved, -(moved.T @ residuals)
    spread, at = shapes.spread, shapes.columns
    own = gram[at[:, :, None], at[:, None, :]] * spread[:, :, None] * spread[:, None, :]
    pulled = pull[at] * spread
    size = own.shape[1]
    inverse = np.linalg.inv(own + np.eye(size))
    scaled = np.einsum("cij,cj->ci", inverse, pulled)
    _, determinant = np.linalg.slogdet(own + np.eye(size))
    fitted = np.einsum("ci,ci->c", pulled, scaled)
    taken = 2.0 * fitted - np.einsum("ci,cij,cj->c", scaled, own, scaled)
    return _Weighed(
        parts=scaled * spread,
        covariance=inverse * spread[:, :, None] * spread[:, None, :],
        gain=0.5 * (fitted - determinant) + shapes.prior,
        steps=_by_steps(gram, pull, float(spread.max())),
        left=float(residuals @ residuals) - taken,
    )


def _by_steps(gram: Array, pull: Array, scale: float) -> float:
    """Log-likelihood gained by the best few steps, one after the other, of sizes like `scale`; in
    tables, shapes (parts, parts) and (parts,), of which the first half are jumps at each point."""
    count = len(pull) // 2
    own, pulled = gram[:count, :count] * scale**2, pull[:count] * scale
    at, best = np.zeros((count, 0), dtype=int), 0.0
    for number in range(1, limits.STEPS_OF_A_COURSE + 1):
        tried = np.column_stack([at, np.arange(count)])
        inner = own[tried[:, :, None], tried[:, None, :]] + np.eye(number)
        right = pulled[tried]
        fitted = np.einsum("ci,ci->c", right, np.linalg.solve(inner, right[:, :, None])[:, :, 0])
        gain = 0.5 * (fitted - np.linalg.slogdet(inner)[1]) - number * np.log(count)
        most = int(np.argmax(gain))
        if gain[most] <= best:
            break
        best, at = float(gain[most]), np.repeat(tried[most : most + 1], count, axis=0)
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
        found: np.ndarray = self.test.members[:, 0]
        return found

    @cached_property
    def sound(self) -> tuple[Array, Array]:
        """Residuals made white, shape (m,), and what makes them so, shape (m, m)."""
        white = _whitener(self.test.spread.whole(self.test.members, None)[0])
        return white @ self.test.residuals[0], white

    def gain_at_first(self, fault: int) -> float:
        """By how much a course explains more than a sound plant does, to first order; minus
        infinity where no estimate shows the fault."""
        residuals, white = self.sound
        slopes = self._in_columns(self.test.effects([fault])[0, :, 0])
        if not slopes.any():
            return -np.inf
        few = np.arange(0, len(self.time), limits.ONSETS_AT_FIRST)
        return _log_sum(_weighed(self.shapes(fault, few), white @ slopes, residuals).gain)

    def shapes(self, fault: int, onsets: np.ndarray | None = None) -> Shapes:
        """Courses that the degree of a fault may take."""
        spec = self.test.ruleset.faults[fault]
        every = np.arange(0, len(self.time), 2) if onsets is None else onsets
        key = spec.scale, every.tobytes()
        if key not in self.known:
            self.known[key] = shapes_of(self.time, every, limits.USUAL_DEGREE * spec.scale)
        return self.known[key]

    def course(self, fault: int, onsets: np.ndarray | None = None) -> Course | None:
        """The course that explains most; None where there is none that anyone would believe."""
        spec, shapes = self.test.ruleset.faults[fault], self.shapes(fault, onsets)
        degree = np.zeros(len(self.time))
        for _ in range(limits.FIT_STEPS):
            residuals, slopes, white = self._undone(fault, degree)
            weighed = _weighed(shapes, white @ slopes, white @ (residuals - slopes @ degree))
            weight = np.exp(weighed.gain - _log_sum(weighed.gain))
            path = _paths(shapes, weighed, weight)
            before, degree = degree, np.clip(path[0], spec.lowest, spec.credible)
            if np.max(np.abs(degree - before)) < limits.COURSE_CONVERGED * spec.scale:
                break
        if not np.isfinite(path).all() or (path[0] < spec.lowest - limits.COVERAGE * path[1]).any():
            return None
        if path[0].max() >= spec.credible:
            return None
        best = int(np.argmax(weight))
        steps = max(_log_sum(weighed.gain[shapes.steps]), weighed.steps)
        base = -0.5 * float(np.sum((white @ (residuals - slopes @ degree)) ** 2))
        sound = -0.5 * float(np.sum(self.sound[0] ** 2))
        evidence = base + _log_sum(weighed.gain)
        now, rate, shared = _at_end(shapes, weighed, weight, self.end)
        if not spec.lowest - limits.COVERAGE * now[1] <= now[0] < spec.credible:
            return None
        left, count = self._left(fault, degree, shapes)
        wide = max(left / count, 1.0) ** 0.5 if left > count else 1.0
        return Course(
            fault=fault,
            time=self.time,
            degree=path[0],
            u=wide * path[1],
            now=(now[0], wide * now[1]),
            rate=(rate[0], wide * rate[1]),
            shared=wide**2 * shared,
            bend=float(weight @ shapes.bends),
            onset=int(shapes.onsets[best]),
            evidence=evidence,
            gain=evidence - sound,
            grown=_log_sum(weighed.gain[~shapes.steps]) - steps,
            left=left,
            residuals=count,
        )

    def _columns(self, fault: int, degree: Array) -> Columns:
        spec = self.test.ruleset.faults[fault]
        names = self.test.touched((spec,))
        return Columns(
            test=replace(self.test, present=degree[:, None], known=None),
            hypotheses=[(spec,)],
            touched=[names],
            which=np.zeros(1, dtype=int),
            most=len(names),
        )

    def _undone(self, fault: int, degree: Array, *, lenient: bool = False) -> tuple[Array, ...]:
        """Residuals with the fault undone, their slopes by the degree at each point, and what makes
        them white; `lenient`: with the tolerance of the fault's law."""
        columns, basis = self._columns(fault, degree), self.test.basis
        moved, slopes = columns.undone(degree[None, :, None])
        places = columns.places[:, 0]
        own = basis[:, places]
        residuals = self.test.residuals[0] + (own @ moved[:, :, 0]).T.ravel()
        table = self._in_columns((own @ slopes[:, 0, :, 0]).T.ravel())
        scales = columns.scales(np.ones((1, 1)))
        covariance = self.test.spread.whole(self.test.members, scales)[0]
        if lenient:
            tolerance = self.test.ruleset.faults[fault].tolerance
            for row, place in enumerate(places):
                off = tolerance * (moved[row, :, 0][:, None] * basis[:, place]).ravel()
                covariance = covariance + np.outer(off, off)
        return residuals, table, _whitener(covariance)

    def _left(self, fault: int, degree: Array, shapes: Shapes) -> tuple[float, int]:
        """Chi-square left with the tolerance of the fault's law, and the number of residuals."""
        residuals, slopes, white = self._undone(fault, degree, lenient=True)
        weighed = _weighed(shapes, white @ slopes, white @ (residuals - slopes @ degree))
        return float(weighed.left[int(np.argmax(weighed.gain))]), len(residuals)

    def _in_columns(self, slopes: Array) -> Array:
        """Slopes of the residuals of each point, shape (m,), by the degree at each point."""
        count = len(self.time)
        table = np.zeros((count, len(slopes) // count, count))
        table[np.arange(count), :, np.arange(count)] = slopes.reshape(count, -1)
        return table.reshape(-1, count)


def stack_of(
    ruleset: Ruleset,
    observed: Observed,
    points: np.ndarray,
    end: float,
    named: list[int],
) -> Stack | None:
    """Points of a part stacked, of many some; None where they are too few. Of a large part only
    what tells of the `named` faults."""
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
        some, told = Contrasts(one, len(members)).basis(named)
        if not told:
            return None
        test = test.seen_by(some)
    return Stack(test=test, time=time, end=max(end, float(time[-1])))


def _whitener(covariance: Array) -> Array:
    """What makes residuals of a covariance, shape (m, m), white."""
    ridge = limits.RIDGE * float(np.trace(covariance))
    root = np.linalg.cholesky(covariance + ridge * np.eye(len(covariance)))
    white: Array = np.linalg.inv(root)
    return white


def _log_sum(values: Array) -> float:
    top = float(np.max(values, initial=-np.inf))
    return top + float(np.log(np.sum(np.exp(values - top)))) if np.isfinite(top) else -np.inf


def _paths(shapes: Shapes, weighed: _Weighed, weight: Array) -> tuple[Array, Array]:
    """Mean of the degree at each point over all courses, and its standard uncertainty."""
    chosen = np.flatnonzero(weight > limits.IMPROBABLE)
    parts = shapes.table[:, shapes.columns[chosen]].transpose(1, 0, 2)
    mean = np.einsum("ckp,cp->ck", parts, weighed.parts[chosen])
    own = np.einsum("ckp,cpq,ckq->ck", parts, weighed.covariance[chosen], parts)
    return _mixed(weight[chosen], mean, own)


def _at_end(
    shapes: Shapes, weighed: _Weighed, weight: Array, end: float
) -> tuple[tuple[float, float], tuple[float, float], float]:
    """Degree and rate at a time, each with its standard uncertainty, and their covariance."""
    time, whole = shapes.time, float(shapes.time[-1] - shapes.time[0])
    count = len(time)
    level = np.concatenate([np.ones(count), np.maximum(end - time, 0.0) / whole])
    slope = np.concatenate([np.zeros(count), np.ones(count) / whole])
    both = np.stack([level, slope])[:, shapes.columns]
    mean = np.einsum("tcp,cp->ct", both, weighed.parts)
    own = np.einsum("tcp,cpq,scq->cts", both, weighed.covariance, both)
    middle = weight @ mean
    apart = mean - middle
    whole_covariance = np.einsum("c,cts->ts", weight, own + apart[:, :, None] * apart[:, None])
    u = np.sqrt(np.maximum(np.diagonal(whole_covariance), 0.0))
    return (
        (float(middle[0]), float(u[0])),
        (float(middle[1]), float(u[1])),
        float(whole_covariance[0, 1]),
    )


def _mixed(weight: Array, mean: Array, variance: Array) -> tuple[Array, Array]:
    """Mean and standard deviation of a mixture, shape (points,) each; of each (courses, points)."""
    share = weight / weight.sum()
    middle = share @ mean
    u: Array = np.sqrt(np.maximum(share @ (variance + (mean - middle) ** 2), 0.0))
    return middle, u
