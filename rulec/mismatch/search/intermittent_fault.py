"""Faults that come and go: the course of a degree, cut into periods.

The degree that explains the residuals best is estimated at every point. Its course in time is cut
where a step pays for itself; levels that differ from those at rest are periods of the fault.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust_statistics import white_noise

from rulec.effects.candidate import Candidate, Unknown
from rulec.mismatch.evidence.configuration import Course, Span
from rulec.mismatch.evidence.steady.fit import Fitted, fit, student_weights
from rulec.mismatch.evidence.steady.model import onset_of
from rulec.mismatch.evidence.steady.screen import (
    InitialCandidate,
    ScoreTest,
    columns_of,
    score_tests_at,
)
from rulec.mismatch.search import limits


@dataclass(frozen=True)
class Segments:
    """A course cut into levels; the means ``first[i] : first[i + 1]`` have one level."""

    first: NDArray[np.intp]
    level: Array
    length: NDArray[np.intp]


def cut(course: Array, penalty: float) -> Segments:
    """Cut a course with unit noise into levels, each of which costs a penalty.

    Source: optimal partitioning (Jackson et al. 2005) with the penalty of Yao 1988.

    >>> import numpy as np
    >>> found = cut(np.array([0.0, 0.1, -0.1, 9.0, 9.1, 8.9]), 5.0)
    >>> found.first.tolist(), found.level.round(6).tolist()
    ([0, 3], [0.0, 9.0])
    """
    n = len(course)
    sums = np.concatenate([[0.0], np.cumsum(course)])
    squares = np.concatenate([[0.0], np.cumsum(course**2)])
    best, before = np.full(n + 1, -penalty), np.zeros(n + 1, dtype=int)
    for end in range(1, n + 1):
        own = squares[end] - squares[:end] - (sums[end] - sums[:end]) ** 2 / np.arange(end, 0, -1)
        cost = best[:end] + own + penalty
        before[end] = int(np.argmin(cost))
        best[end] = cost[before[end]]
    edges = [n]
    while edges[-1]:
        edges.append(int(before[edges[-1]]))
    first, length = np.array(edges[:0:-1]), np.diff(edges[::-1])
    return Segments(first, (sums[first + length] - sums[first]) / length, length)


def apart(segments: Segments, odd: float = 0.0) -> np.ndarray:
    """Flag the levels that are not at rest; a share `odd` of the time may be outliers at each end.

    The split leaves the least scatter within both classes. The longer class is at rest, or the
    lower one if the degree cannot be negative. The class at rest is split again as long as it has
    two states, since a fault may have several degrees.

    Source: two classes of levels (Otsu 1979).
    """
    level, length = segments.level, segments.length
    order = np.argsort(level)
    share = np.cumsum(length[order]) / length.sum()
    ends = np.minimum(np.searchsorted(share, [odd, 1.0 - odd]), len(order) - 1)
    level = np.clip(level, *level[order][ends])
    on, rest = np.zeros(len(level), dtype=bool), np.flatnonzero(length >= limits.SHORTEST)
    while len(rest) > 1:
        order = rest[np.argsort(level[rest])]
        time, total = (np.cumsum(v[order]) for v in (length, length * level))
        low, high, mean = time[:-1], time[-1] - time[:-1], total[-1] / time[-1]
        between = (total[:-1] - low * mean) ** 2 * (1.0 / low + 1.0 / high)
        split = int(np.argmax(between))
        scatter = float(length[order] @ (level[order] - mean) ** 2)
        # Levels of one state differ by noise: two states must pay for themselves.
        least = limits.STEP_PENALTY * float(np.log(length.sum()))
        middle = float(level[order[split : split + 2]].mean())
        above = level > middle
        steps = np.abs(np.diff(level[rest]))[np.diff(above[rest])]
        distance = level[order[split + 1 :]].mean() - level[order[: split + 1]].mean()
        if not (
            between[split] >= max(limits.TWO_STATES * scatter, least)
            and len(steps)
            and np.median(steps) > limits.AT_ONCE * distance
        ):
            break
        # Of a degree that cannot be negative, the lower state is at rest.
        rests_low = level[order[-1]] > -level[order[0]] or low[split] >= high[split]
        on |= above if rests_low else level < middle
        rest = rest[~on[rest]]
    return on


def runs_of(segments: Segments, on: np.ndarray) -> list[tuple[int, int]]:
    """First and last mean (excluded) of each period; adjacent similar levels are one period."""
    first = segments.first
    last = first + segments.length
    runs: list[tuple[int, int, float]] = []
    rest = float(np.average(segments.level[~on], weights=segments.length[~on]))
    for i in np.flatnonzero(on):
        begin, level = int(first[i]), float(segments.level[i]) - rest
        near = limits.ONE_LEVEL * abs(level)
        if runs and runs[-1][1] == begin and abs(level - runs[-1][2]) < near:
            begin, _, before = runs.pop()
            level = before + (last[i] - first[i]) / (last[i] - begin) * (level - before)
        runs.append((begin, int(last[i]), level))
    return [(begin, end) for begin, end, _ in runs]


def few_levels(
    levels: Array, lengths: NDArray[np.intp], most: int = limits.MOST_LEVELS
) -> tuple[NDArray[np.intp], Array]:
    """Number of the level of each period, and the fewest levels that explain the scatter.

    A fault that comes and goes has a few degrees; a different one each time is no fault.

    >>> number, centres = few_levels(np.array([0.2, 0.21, 0.4]), np.array([5, 5, 5]))
    >>> number.tolist(), centres.round(3).tolist()
    ([0, 0, 1], [0.205, 0.4])
    """

    def centred(number: NDArray[np.intp]) -> tuple[float, NDArray[np.intp], Array]:
        centres = np.bincount(number, lengths * levels) / np.bincount(number, lengths)
        return float(lengths @ (levels - centres[number]) ** 2), number, centres

    rank = np.argsort(np.argsort(levels))
    whole, best, centres = centred(np.zeros(len(levels), dtype=np.intp))
    for count in range(2, min(most, len(levels)) + 1 if whole > 0.0 else 2):
        splits = itertools.islice(itertools.combinations(range(1, len(levels)), count - 1), 5000)
        ways = (centred(np.searchsorted(split, rank, side="right")) for split in splits)
        left, best, centres = min(ways, key=lambda way: way[0])
        if left <= limits.LEVELS_LEAVE * whole:
            break
    return best, centres


def intermittent(fitted: Fitted, candidates: Sequence[Candidate]) -> list[InitialCandidate]:
    """The faults among the candidates that gain most if they come and go, by falling gain."""
    if not fitted.rows.system.data.timed:
        return []
    trials = [in_periods(fitted, c) for c in candidates if c.sort == "fault"]
    found = [t for t in trials if t is not None]
    return sorted(found, key=lambda t: -t.gain)[: limits.COMING]


def in_periods(fitted: Fitted, candidate: Candidate) -> InitialCandidate | None:
    """A fault that comes and goes; None where its degree shows no such course."""
    unknown = next((u for u in candidate.unknowns if u.null is not None), None)
    if unknown is None or unknown.null is None:
        return None
    columns = columns_of(fitted, candidate, {unknown.id: unknown.null}, {})
    if columns is None:
        return None
    degree, weight = degree_course(fitted, columns[:, 0])
    # Held-out points do not count, but a period includes those within it.
    used = np.flatnonzero(np.isfinite(degree) & fitted.used)
    if len(used) < 4 * limits.SHORTEST:
        return None
    edges = np.linspace(0, len(used), min(limits.LONGEST_COURSE, len(used)) + 1).astype(int)
    sums = np.add.reduceat(weight[used], edges[:-1])
    value = np.add.reduceat((weight * degree)[used], edges[:-1]) / sums
    # Robust against steps.
    noise = white_noise(np.diff(value), 1) or float(np.std(value)) or 1.0
    course = _Degree(
        fitted=fitted,
        tests=score_tests_at(fitted),
        candidate=candidate,
        unknown=unknown,
        column=columns[:, 0],
        first=used[edges[:-1]],
        last=used[edges[1:] - 1],
        value=value,
        weight=sums,
    )
    segments = cut(value / noise, limits.STEP_PENALTY * float(np.log(len(value))))
    states = [apart(segments, odd) for odd in limits.ODD]
    some = [on for on in states if on.any() and not on.all()]
    each = [*some, *(_longest(segments, on) for on in some), *(_hull(on) for on in some)]
    ways = [(segments, on) for on in {on.tobytes(): on for on in each}.values()]
    if len(segments.first) > 1:
        ways.append((course.begun(), np.array([False, True])))
    trials = [
        course.trial(*way, levels)
        for way in ways
        for levels in (1, limits.MOST_LEVELS)
        if not way[1].all()
    ]
    return max((t for t in trials if t is not None), key=course.worth, default=None)


def _longest(segments: Segments, on: np.ndarray) -> np.ndarray:
    """The longest period only: the others may be noise."""
    first, last = max(runs_of(segments, on), key=lambda run: run[1] - run[0])
    return np.asarray((segments.first >= first) & (segments.first < last) & on)


def _hull(on: np.ndarray) -> np.ndarray:
    """One period from the first to the last: the gaps may be noise as well."""
    return np.logical_or.accumulate(on) & np.logical_or.accumulate(on[::-1])[::-1]


@dataclass(frozen=True, kw_only=True)
class _Degree:
    """The course of the degree of a fault as means over known points from `first` to `last`, with
    their weights; `column`, shape (rows,), are the slopes of the residuals by the degree."""

    fitted: Fitted
    tests: Sequence[ScoreTest]
    candidate: Candidate
    unknown: Unknown
    column: Array
    first: NDArray[np.intp]
    last: NDArray[np.intp]
    value: Array
    weight: Array

    @property
    def _null(self) -> float:
        return self.unknown.null or 0.0

    def begun(self) -> Segments:
        """One permanent change, at the time that explains most.

        Values are refitted beside it: those of a plain fit lie between the values before and after
        the change, and so hide a part of it.
        """
        count, null = len(self.value), self._null
        ends = limits.SHORTEST, count - limits.SHORTEST
        begins = np.unique(np.linspace(*ends, limits.BEGINS).astype(int))
        terms = self.column[:, None] * (self.fitted.rows.point[:, None] >= self.first[begins])
        low, high = self.unknown.lowest - null, self.unknown.highest - null
        whole = np.ones(len(begins))
        each = np.arange(len(begins))[:, None]
        gains = np.max(
            [test.best_of(terms, each, low * whole, high * whole)[1] for test in self.tests], axis=0
        )
        first = np.array([0, begins[int(np.argmax(gains))]])
        length = np.diff(np.append(first, count))
        return Segments(first, np.add.reduceat(self.value, first) / length, length)

    def trial(self, segments: Segments, on: np.ndarray, most: int) -> InitialCandidate | None:
        """The fault with at most `most` degrees; None where no period is long enough."""
        null, sums = self._null, np.add.reduceat(self.value, segments.first)
        rest = float(sums[~on].sum() / segments.length[~on].sum())
        runs, levels = [], []
        for begin, end in runs_of(segments, on):
            level = float(np.average(self.value[begin:end], weights=self.weight[begin:end])) - rest
            level = float(np.clip(null + level, self.unknown.lowest, self.unknown.highest))
            if level != null and end - begin >= limits.SHORTEST:
                runs.append((begin, end))
                levels.append(level)
        if not runs:
            return None
        number, centres = few_levels(np.array(levels), np.array([b - a for a, b in runs]), most)
        joined = list[tuple[int, int, int]]()
        for (begin, end), own in zip(runs, number.tolist(), strict=True):
            # A short gap between two periods of one level is closed.
            if joined and joined[-1][2] == own and begin - joined[-1][1] < limits.SHORTEST:
                begin = joined.pop()[0]
            joined.append((begin, end, own))
        time, point = self.fitted.rows.system.data.time, self.fitted.rows.point
        segment, periods = np.full(len(time), -1), []
        for begin, end, own in joined:
            a, b = self.first[begin], self.last[end - 1]
            segment[a : b + 1] = own
            periods.append(Span(float(time[a]), float(time[b]), own))
        course = Course(self.unknown.id, segment, tuple(periods))
        values = dict(zip(course.names(), centres.tolist(), strict=True))
        term, wide = self.column * (course.degrees(values) - null)[point], np.array([np.inf])
        gain = max(test.best(term[:, None], -wide, wide)[1] for test in self.tests)
        return InitialCandidate(
            candidate=self.candidate, values=values, fixed={}, gain=gain, course=course
        )

    def worth(self, trial: InitialCandidate) -> float:
        """Gain of a trial less the penalty of its periods and degrees.

        A fault that begins is likelier than one that was there and ended.
        """
        course = trial.course
        assert course is not None
        each = 0.5 * float(np.log(max(self.fitted.rows.groups, 2)))
        begins = course.segment[0] < 0 and course.periods[0].since > 0.0
        penalty = each * (limits.PERIOD_PENALTY * len(course.periods) + course.levels)
        return trial.gain * (1.0 if begins else limits.PASSING) - penalty


def degree_course(fitted: Fitted, column: Array) -> tuple[Array, Array]:
    """The degree that explains each point best, shape (n,), and its weight (1/variance).

    NaN at points where no residual depends on it.
    """
    rows = fitted.rows
    n = len(rows.system.data)
    # Outliers of the model count little here as well.
    sound = column * student_weights(rows, fitted.residual, fitted.scale)
    weight = np.bincount(rows.point, column * sound, minlength=n).astype(float)
    moment = np.bincount(rows.point, sound * fitted.residual, minlength=n).astype(float)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Whether residuals depend on the degree has nothing to do with their size. Where a module
        # moves, only rounding errors are left of its slopes.
        slope = np.bincount(rows.point, column**2, minlength=n).astype(float)
        least = limits.FAINT * float(np.sum(slope**2) / max(np.sum(slope), 1e-300))
        degree: Array = np.where(slope > least, -moment / weight, np.nan)
    return degree, weight


def with_refined_onset(fitted: Fitted, unknown: str) -> Fitted:
    """Refit with a better onset of one unknown, if it lasts to the end: of a step the best point
    near it, of a growing fault by Gauss-Newton steps, each halved until it pays."""
    time, best = fitted.rows.system.data.time, fitted
    course = next(c for c in fitted.setting.courses if c.unknown == unknown)
    if len(course.periods) != 1 or course.segment[-1] < 0:
        return fitted
    if not course.grows:
        near = np.abs(time - course.periods[0].since)
        window = np.sort(np.argsort(near)[: 2 * limits.ONSET_POINTS])
        ends = window[0], window[-1]
        for at in np.unique(np.linspace(*ends, limits.ONSET_POINTS).astype(int)):
            moved = _since(best, unknown, float(time[at]))
            best = moved if moved.objective < best.objective else best
        return best
    for _ in range(limits.ONSET_POINTS):
        course = next(c for c in best.setting.courses if c.unknown == unknown)
        since, step = course.periods[0].since, onset_of(best, course).step
        begins = (np.clip(since + share * step, time[0], time[-2]) for share in (1.0, 0.5, 0.25))
        trials = (_since(best, unknown, float(begin)) for begin in begins)
        better = next((trial for trial in trials if trial.objective < best.objective), None)
        if better is None:
            break
        best = better
    return best


def _since(fitted: Fitted, unknown: str, begin: float) -> Fitted:
    """Refit with another onset, s."""
    time, courses = fitted.rows.system.data.time, fitted.setting.courses
    own = tuple(c.since(begin, time) if c.unknown == unknown else c for c in courses)
    return fit(
        fitted.rows,
        replace(fitted.setting, courses=own),
        fitted.used,
        limits.HALF_STEPS,
        variance_inflation=fitted.variance_inflation,
    )
