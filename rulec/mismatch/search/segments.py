"""Cut a course in time into levels, and find those levels that are states of their own.

Source: optimal partitioning (Jackson et al. 2005) with the penalty of Yao 1988; two classes of
levels by Otsu 1979.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.mismatch.search import limits


@dataclass(frozen=True)
class Segments:
    """A course cut into levels; the means ``first[i] : first[i + 1]`` have one level."""

    first: NDArray[np.intp]
    level: Array
    length: NDArray[np.intp]


def cut(course: Array, penalty: float) -> Segments:
    """Cut a course with unit noise into levels, each of which costs a penalty.

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
