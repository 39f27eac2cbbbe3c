"""Faults that come and go: the course of a degree, cut into periods.

The degree that would explain the residuals best is found at every point. Its course in time is cut
where a step pays for itself; levels that stand apart from those at rest are periods of the fault.

Source: optimal partitioning (Jackson et al. 2005) with the penalty of Yao 1988; two classes of
levels by Otsu 1979.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.mismatch.candidate import Candidate
from runtime.mismatch.fit import Fitted
from runtime.mismatch.screen import Trial, columns_of
from runtime.mismatch.setting import Course
from runtime.plan import Array

LONGEST_COURSE = 1500
"""Means that a course is reduced to before it is cut."""

PENALTY = 4.0
"""Price of a step, in log(means): its time and its level."""

APART = 0.75
"""Share of the scatter of all levels that two states explain, if there are two: an even spread of
levels gives as much."""

SUDDEN = 0.6
"""Share of the distance between two states that a change from one to the other has at once: what
swings slowly is no fault that comes and goes."""

ALIKE = 0.25
"""Levels that follow each other and differ by less than this share are one period."""

SHORTEST = 3
"""Means that a period has at least."""


@dataclass(frozen=True)
class Segments:
    """A course cut into levels: ``first[i] : first[i + 1]`` are means of one level."""

    first: NDArray[np.intp]
    level: Array
    length: NDArray[np.intp]


def in_periods(fitted: Fitted, candidate: Candidate) -> Trial | None:
    """A fault as one that comes and goes; None where its degree shows no such course."""
    unknown = next((u for u in candidate.unknowns if u.null is not None), None)
    if unknown is None or unknown.null is None:
        return None
    columns = columns_of(fitted, candidate, {unknown.id: unknown.null}, {})
    if columns is None:
        return None
    degree, certainty = degree_course(fitted, columns[:, 0])
    # Held-out points are not looked at; a period reaches over those inside it.
    known = np.flatnonzero(np.isfinite(degree) & fitted.used)
    if len(known) < 4 * SHORTEST:
        return None
    edges = np.linspace(0, len(known), min(LONGEST_COURSE, len(known)) + 1).astype(int)
    weights = certainty[known]
    sums = np.add.reduceat(weights, edges[:-1])
    means = np.add.reduceat(weights * degree[known], edges[:-1]) / sums
    noise = _noise(means)
    segments = cut(means / noise, PENALTY * float(np.log(len(means))))
    on = apart(segments)
    if not on.any():
        return None
    segment = np.full(len(degree), -1)
    rest = float(np.average(segments.level[~on], weights=segments.length[~on])) * noise
    periods: list[tuple[float, float]] = []
    levels: list[float] = []
    for first, last in _runs(segments, on):
        inside = known[edges[first] : edges[last]]
        level = float(np.average(means[first:last], weights=sums[first:last])) - rest
        level = float(np.clip(unknown.null + level, unknown.lowest, unknown.highest))
        if level == unknown.null or last - first < SHORTEST:
            continue
        segment[inside[0] : inside[-1] + 1] = len(periods)
        time = fitted.rows.system.data.time
        periods.append((float(time[inside[0]]), float(time[inside[-1]])))
        levels.append(level)
    if not periods:
        return None
    course = Course(unknown.id, segment, tuple(periods))
    values = dict(zip(course.names(), levels, strict=True))
    return Trial(candidate, values, {}, 0.0, course)


def degree_course(fitted: Fitted, column: Array) -> tuple[Array, Array]:
    """The degree that explains each point best, shape (n,), and its weight (1/variance).

    NaN at points that no residual speaks of.
    """
    rows = fitted.rows
    n = len(rows.system.data)
    weight = np.bincount(rows.point, column**2, minlength=n).astype(float)
    moment = np.bincount(rows.point, column * fitted.residual, minlength=n).astype(float)
    with np.errstate(invalid="ignore", divide="ignore"):
        degree: Array = np.where(weight > 0, -moment / weight, np.nan)
    return degree, weight


def _noise(means: Array) -> float:
    """Standard deviation of a course about its levels, robust against steps."""
    steps = np.diff(means)
    robust = 1.4826 * float(np.median(np.abs(steps))) / np.sqrt(2.0)
    return robust or float(np.std(means)) or 1.0


def cut(course: Array, penalty: float) -> Segments:
    """Cut a course with unit noise into levels, each paid for.

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


def apart(segments: Segments) -> np.ndarray:
    """Which levels are a state of their own, away from those at rest.

    The split that leaves least scatter within both classes; at rest is the longer class, or the
    lower one of a degree that cannot be negative.
    """
    level, length = segments.level, segments.length
    flags = np.zeros(len(level), dtype=bool)
    lasting = np.flatnonzero(length >= SHORTEST)
    if len(lasting) < 2:
        return flags
    order = lasting[np.argsort(level[lasting])]
    scatter = [
        _scatter(level[order[:i]], length[order[:i]])
        + _scatter(level[order[i:]], length[order[i:]])
        for i in range(1, len(order))
    ]
    split = int(np.argmin(scatter)) + 1
    whole = _scatter(level[order], length[order])
    low, high = order[:split], order[split:]
    if whole <= 0 or 1.0 - scatter[split - 1] / whole < APART:
        return flags
    middle = 0.5 * float(level[low].max() + level[high].min())
    one_sided = _one_sided(level[order])
    rest_is_low = one_sided or length[low].sum() >= length[high].sum()
    above: np.ndarray = level > middle
    if not _changes_at_once(level, lasting, above):
        return flags
    return above if rest_is_low else ~above


def _changes_at_once(level: Array, lasting: NDArray[np.intp], above: np.ndarray) -> bool:
    """Is a change of state a step, with no more than a short segment between?"""
    before, after = lasting[:-1], lasting[1:]
    changed = above[before] != above[after]
    if not changed.any():
        return False
    steps = np.abs(level[after] - level[before])[changed]
    distance = float(level[lasting][above[lasting]].mean() - level[lasting][~above[lasting]].mean())
    return float(np.median(steps)) > SUDDEN * distance


def _one_sided(level: Array) -> bool:
    """Levels above those at rest are what a degree that cannot be negative gives."""
    return bool(level.max() > -level.min())


def _scatter(level: Array, length: NDArray[np.intp]) -> float:
    mean = float(np.average(level, weights=length))
    return float(np.sum(length * (level - mean) ** 2))


def _runs(segments: Segments, on: np.ndarray) -> list[tuple[int, int]]:
    """First and last mean (excluded) of each period: neighbours at about one level are one."""
    first = segments.first
    last = first + segments.length
    runs: list[tuple[int, int, float]] = []
    rest = float(np.average(segments.level[~on], weights=segments.length[~on]))
    for i in np.flatnonzero(on):
        level = float(segments.level[i]) - rest
        if runs and runs[-1][1] == first[i] and abs(level - runs[-1][2]) < ALIKE * abs(level):
            begin, _, known = runs[-1]
            share = (last[i] - first[i]) / (last[i] - begin)
            runs[-1] = (begin, int(last[i]), known + share * (level - known))
        else:
            runs.append((int(first[i]), int(last[i]), level))
    return [(begin, end) for begin, end, _ in runs]
