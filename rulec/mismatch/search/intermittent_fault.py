"""Faults that come and go: the course of a degree, cut into periods.

The degree that explains the residuals best is estimated at every point. Its course in time is cut
where a step pays for itself; levels that differ from those at rest are periods of the fault.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
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
    best = np.full(n + 1, np.inf)
    best[0] = -penalty
    before = np.zeros(n + 1, dtype=int)
    starts = np.arange(n)
    for end in range(1, n + 1):
        low = starts[:end]
        length = end - low
        total = sums[end] - sums[low]
        cost = best[low] + (squares[end] - squares[low]) - total**2 / length + penalty
        before[end] = int(np.argmin(cost))
        best[end] = cost[before[end]]
    edges = [n]
    while edges[-1]:
        edges.append(int(before[edges[-1]]))
    first = np.array(edges[:0:-1])
    length = np.diff(np.append(first, n))
    level = (sums[first + length] - sums[first]) / length
    return Segments(first, level, length)


def apart(segments: Segments, odd: float = 0.0) -> np.ndarray:
    """Flag the levels that are not at rest; a share `odd` of the time may be outliers at each end.

    The split leaves the least scatter within both classes. The longer class is at rest, or the
    lower one if the degree cannot be negative. The class at rest is split again as long as it has
    two states, since a fault may have several degrees.

    Source: two classes of levels (Otsu 1979).
    """
    on = np.zeros(len(segments.level), dtype=bool)
    order = np.argsort(segments.level)
    share = np.cumsum(segments.length[order]) / segments.length.sum()
    ends = np.minimum(np.searchsorted(share, [odd, 1.0 - odd]), len(order) - 1)
    segments = replace(segments, level=np.clip(segments.level, *segments.level[order][ends]))
    rest = np.flatnonzero(segments.length >= limits.SHORTEST)
    while True:
        found = _split(segments, rest)
        if found is None:
            return on
        middle, rest_is_low = found
        on |= segments.level > middle if rest_is_low else segments.level < middle
        if not on[rest].any():
            return on
        rest = rest[~on[rest]]


def _split(segments: Segments, lasting: NDArray[np.intp]) -> tuple[float, bool] | None:
    """The level between two states, and whether the lower one is at rest; None for one state."""
    level, length = segments.level, segments.length
    if len(lasting) < 2:
        return None
    order = lasting[np.argsort(level[lasting])]
    scatter = [
        _scatter(level[order[:i]], length[order[:i]])
        + _scatter(level[order[i:]], length[order[i:]])
        for i in range(1, len(order))
    ]
    split = int(np.argmin(scatter)) + 1
    whole = _scatter(level[order], length[order])
    low, high = order[:split], order[split:]
    if whole <= 0 or 1.0 - scatter[split - 1] / whole < limits.TWO_STATES:
        return None
    # Levels of one state differ by noise: two states must pay for themselves.
    if whole - scatter[split - 1] < limits.STEP_PENALTY * float(np.log(length.sum())):
        return None
    middle = 0.5 * float(level[low].max() + level[high].min())
    if not _changes_at_once(level, lasting, level > middle):
        return None
    # Of a degree that cannot be negative, the lower state is at rest.
    one_sided = bool(level[order].max() > -level[order].min())
    return middle, one_sided or length[low].sum() >= length[high].sum()


def _changes_at_once(level: Array, lasting: NDArray[np.intp], above: np.ndarray) -> bool:
    """Is a change of state a step, with at most a short segment in between?"""
    before, after = lasting[:-1], lasting[1:]
    changed = above[before] != above[after]
    if not changed.any():
        return False
    steps = np.abs(level[after] - level[before])[changed]
    distance = float(level[lasting][above[lasting]].mean() - level[lasting][~above[lasting]].mean())
    return float(np.median(steps)) > limits.AT_ONCE * distance


def _scatter(level: Array, length: NDArray[np.intp]) -> float:
    mean = float(np.average(level, weights=length))
    return float(np.sum(length * (level - mean) ** 2))


def runs_of(segments: Segments, on: np.ndarray) -> list[tuple[int, int]]:
    """First and last mean (excluded) of each period; adjacent similar levels are one period."""
    first = segments.first
    last = first + segments.length
    runs: list[tuple[int, int, float]] = []
    rest = float(np.average(segments.level[~on], weights=segments.length[~on]))
    for i in np.flatnonzero(on):
        level = float(segments.level[i]) - rest
        if (
            runs
            and runs[-1][1] == first[i]
            and abs(level - runs[-1][2]) < limits.ONE_LEVEL * abs(level)
        ):
            begin, _, known = runs[-1]
            share = (last[i] - first[i]) / (last[i] - begin)
            runs[-1] = (begin, int(last[i]), known + share * (level - known))
        else:
            runs.append((int(first[i]), int(last[i]), level))
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
    order = np.argsort(levels)
    whole = _scatter(levels, lengths)
    best = np.zeros(len(levels), dtype=int)
    for count in range(1, min(most, len(levels)) + 1):
        splits = itertools.combinations(range(1, len(levels)), count - 1)
        parts = [np.split(order, split) for split in itertools.islice(splits, 5000)]
        scatters = [sum(_scatter(levels[p], lengths[p]) for p in part) for part in parts]
        chosen = parts[int(np.argmin(scatters))]
        for i, part in enumerate(chosen):
            best[part] = i
        if min(scatters) <= limits.LEVELS_LEAVE * whole or whole <= 0:
            break
    centres = [
        float(np.average(levels[best == i], weights=lengths[best == i]))
        for i in range(int(best.max()) + 1)
    ]
    return best, np.array(centres)


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
    tests, column = score_tests_at(fitted), columns[:, 0]
    degree, weight = degree_course(fitted, column)
    # Held-out points do not count, but a period includes those within it.
    known = np.flatnonzero(np.isfinite(degree) & fitted.used)
    if len(known) < 4 * limits.SHORTEST:
        return None
    edges = np.linspace(0, len(known), min(limits.LONGEST_COURSE, len(known)) + 1).astype(int)
    weight = weight[known]
    sums = np.add.reduceat(weight, edges[:-1])
    value = np.add.reduceat(weight * degree[known], edges[:-1]) / sums
    # Robust against steps.
    noise = white_noise(np.diff(value), 1) or float(np.std(value)) or 1.0
    segments = cut(value / noise, limits.STEP_PENALTY * float(np.log(len(value))))
    states = [apart(segments, odd) for odd in limits.ODD]
    some = [on for on in states if on.any() and not on.all()]
    states = [*some, *(_longest(segments, on) for on in some), *(_hull(on) for on in some)]
    means = _Means(known, edges, value, sums, noise)
    ways = list({tuple(np.flatnonzero(on)): (segments, on) for on in states}.values())
    if len(segments.first) > 1:
        ways.append(_begun(fitted, tests, unknown, column, means))
    trials = [
        _trial(fitted, tests, candidate, unknown, column, means, *way, levels)
        for way in ways
        for levels in (1, limits.MOST_LEVELS)
        if way[1].any() and not way[1].all()
    ]
    each = 0.5 * float(np.log(max(fitted.rows.groups, 2)))
    found = [t for t in trials if t is not None]
    return max(found, key=lambda t: _likely(t, each), default=None)


def _longest(segments: Segments, on: np.ndarray) -> np.ndarray:
    """The longest period only: the others may be noise."""
    first, last = max(runs_of(segments, on), key=lambda run: run[1] - run[0])
    return np.asarray((segments.first >= first) & (segments.first < last) & on)


def _hull(on: np.ndarray) -> np.ndarray:
    """One period from the first to the last: the gaps may be noise as well."""
    there = np.flatnonzero(on)
    inside: np.ndarray = np.zeros(len(on), dtype=bool)
    inside[there[0] : there[-1] + 1] = True
    return inside


def _begun(
    fitted: Fitted, tests: Sequence[ScoreTest], unknown: Unknown, column: Array, means: _Means
) -> tuple[Segments, np.ndarray]:
    """One permanent change, at the time that explains most.

    Values are refitted beside it: those of a plain fit lie between the values before and after the
    change, and so hide a part of it.
    """
    count = len(means.value)
    begins = np.unique(
        np.linspace(limits.SHORTEST, count - limits.SHORTEST, limits.BEGINS).astype(int)
    )
    since = means.known[means.edges[begins]]
    terms = column[:, None] * (fitted.rows.point[:, None] >= since)
    null = unknown.null or 0.0
    low, high = (np.full(len(begins), end - null) for end in (unknown.lowest, unknown.highest))
    each = np.arange(len(begins))[:, None]
    gains = np.max([test.best_of(terms, each, low, high)[1] for test in tests], axis=0)
    first = np.array([0, begins[int(np.argmax(gains))]])
    length = np.diff(np.append(first, count))
    level = np.add.reduceat(means.value, first) / length / means.noise
    return Segments(first, level, length), np.array([False, True])


def _likely(trial: InitialCandidate, each: float) -> float:
    """Gain of a trial less the price of its periods and degrees.

    A fault that begins is likelier than one that was there and ended.
    """
    course = trial.course
    assert course is not None
    first = int(np.flatnonzero(course.segment >= 0)[0])
    begins = first > 0 and course.periods[0].since > 0.0
    price = each * (limits.PERIOD_PRICE * len(course.periods) + course.levels)
    return trial.gain * (1.0 if begins else limits.PASSING) - price


@dataclass(frozen=True)
class _Means:
    """Means of a course over points ``known[edges[i] : edges[i + 1]]``, and their weights."""

    known: NDArray[np.intp]
    edges: NDArray[np.intp]
    value: Array
    weight: Array
    noise: float


def _trial(
    fitted: Fitted,
    tests: Sequence[ScoreTest],
    candidate: Candidate,
    unknown: Unknown,
    column: Array,
    means: _Means,
    segments: Segments,
    on: np.ndarray,
    most: int,
) -> InitialCandidate | None:
    """The fault with at most `most` degrees; None where no period is long enough."""
    null = unknown.null or 0.0
    rest = float(np.average(segments.level[~on], weights=segments.length[~on])) * means.noise
    runs, levels = [], []
    for first, last in runs_of(segments, on):
        level = float(np.average(means.value[first:last], weights=means.weight[first:last])) - rest
        level = float(np.clip(null + level, unknown.lowest, unknown.highest))
        if level != null and last - first >= limits.SHORTEST:
            runs.append((first, last))
            levels.append(level)
    if not runs:
        return None
    number, centres = few_levels(np.array(levels), np.array([b - a for a, b in runs]), most)
    segment = np.full(len(fitted.rows.system.data), -1)
    time = fitted.rows.system.data.time
    periods = []
    for first, last, i in _joined(runs, number):
        inside = means.known[means.edges[first] : means.edges[last]]
        segment[inside[0] : inside[-1] + 1] = i
        periods.append(Span(float(time[inside[0]]), float(time[inside[-1]]), int(i)))
    course = Course(unknown.id, segment, tuple(periods))
    values = dict(zip(course.names(), centres.tolist(), strict=True))
    term = column * (course.degrees(values) - null)[fitted.rows.point]
    wide = np.array([np.inf])
    gain = max(test.best(term[:, None], -wide, wide)[1] for test in tests)
    return InitialCandidate(candidate=candidate, values=values, fixed={}, gain=gain, course=course)


def _joined(
    runs: Sequence[tuple[int, int]], number: NDArray[np.intp]
) -> Iterator[tuple[int, int, int]]:
    """Runs with the number of their level; short gaps between two of one level are closed."""
    first, last, level = *runs[0], int(number[0])
    for (begin, end), i in zip(runs[1:], number[1:].tolist(), strict=True):
        if begin - last < limits.SHORTEST and i == level:
            last = end
            continue
        yield first, last, level
        first, last, level = begin, end, i
    yield first, last, level


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
    """Refit with a better onset of one unknown, if it lasts to the end."""
    course = _course(fitted, unknown)
    if len(course.periods) != 1 or course.segment[-1] < 0:
        return fitted
    return _where_it_grows(fitted, unknown) if course.grows else _where_it_steps(fitted, course)


def _course(fitted: Fitted, unknown: str) -> Course:
    return next(c for c in fitted.setting.courses if c.unknown == unknown)


def _where_it_steps(fitted: Fitted, course: Course) -> Fitted:
    """Try points around an onset."""
    time = fitted.rows.system.data.time
    near = np.abs(time - course.periods[0].since)
    window = np.sort(np.argsort(near)[: 2 * limits.ONSET_POINTS])
    best = fitted
    for at in np.unique(np.linspace(window[0], window[-1], limits.ONSET_POINTS).astype(int)):
        moved = _since(best, course, float(time[at]))
        best = moved if moved.objective < best.objective else best
    return best


def _where_it_grows(fitted: Fitted, unknown: str) -> Fitted:
    """Gauss-Newton steps, each halved until it pays."""
    time = fitted.rows.system.data.time
    best = fitted
    for _ in range(limits.ONSET_POINTS):
        course = _course(best, unknown)
        since, step = course.periods[0].since, onset_of(best, course).step
        for share in (1.0, 0.5, 0.25):
            there = float(np.clip(since + share * step, time[0], time[-2]))
            trial = _since(best, course, there)
            if trial.objective < best.objective:
                best = trial
                break
        else:
            break
    return best


def _since(fitted: Fitted, course: Course, begin: float) -> Fitted:
    """Refit with another onset, s."""
    there = course.since(begin, fitted.rows.system.data.time)
    courses = tuple(there if c.unknown == course.unknown else c for c in fitted.setting.courses)
    return fit(
        fitted.rows,
        replace(fitted.setting, courses=courses),
        fitted.used,
        limits.HALF_STEPS,
        variance_inflation=fitted.variance_inflation,
    )
