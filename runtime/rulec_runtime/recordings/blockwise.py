"""Pass over columns block by block: the same results as at once, with little memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.larger_than_memory import array, blocks, let_go

Flags = np.ndarray
Parts = Callable[[], Iterable[Array]]
"""Gives numbers in parts; each call starts again at the first."""


def parts_of(values: Array, wanted: Callable[[Array], Flags] = np.isfinite) -> Iterator[Array]:
    """The wanted readings in parts, by default all finite ones."""
    for low, high in blocks(len(values), values):
        part = values[low:high]
        yield part[wanted(part)]


def differences(parts: Iterable[Array], order: int) -> Iterator[Array]:
    """Differences of consecutive numbers, also across parts."""
    before = np.zeros(0)
    for part in parts:
        row = np.concatenate([before, part])
        yield np.diff(row, order)
        before = row[-order:]


def any_of(values: Array, function: Callable[[Array], Flags] = np.isfinite) -> bool:
    """Whether a function is true for any number."""
    return any(function(values[low:high]).any() for low, high in blocks(len(values), values))


def first_reading(values: Array) -> float | None:
    """The first number of a column, or None."""
    return next((float(part[0]) for part in parts_of(values) if len(part)), None)


def median_of(parts: Parts) -> float:
    """The exact median of all numbers; NaN of none.

    Many numbers are searched near the median of a sample first, and partitioned only if that fails.
    """
    few: list[Array] = []
    sample: list[Array] = []
    total = 0
    for part in parts():
        total += len(part)
        sample.append(np.array(part[:: limits.SAMPLED]))
        if total <= limits.SORTED_AT_ONCE:
            few.append(np.array(part))
        else:
            few.clear()
    if not total:
        return float("nan")
    if total <= limits.SORTED_AT_ONCE:
        return float(np.median(np.concatenate(few)))
    middle = (total - 1) // 2
    near = _near_middle(np.sort(np.concatenate(sample)))
    one, next_one = _between(parts, middle, *near) or _of_all(parts, total, middle)
    return 0.5 * (one + next_one) if total % 2 == 0 else one


def _near_middle(sample: Array) -> tuple[float, float]:
    """Two numbers that almost surely enclose the median, from a sorted sample."""
    middle, wide = 0.5 * len(sample), limits.MEDIAN_WITHIN * 0.5 * len(sample) ** 0.5
    low, high = max(int(middle - wide), 0), min(int(middle + wide), len(sample) - 1)
    return float(sample[low]), float(sample[high])


def _between(parts: Parts, rank: int, low: float, high: float) -> tuple[float, float] | None:
    """The numbers of a rank and of the next, if `low` and `high` enclose both; equal numbers are
    only counted, since readings often repeat."""
    below = lows = highs = 0
    within: list[Array] = []
    for part in parts():
        below += int(np.count_nonzero(part < low))
        lows += int(np.count_nonzero(part == low))
        highs += int(np.count_nonzero(part == high))
        within.append(part[(part > low) & (part < high)])
    inside = np.sort(np.concatenate(within))
    ends = below, below + lows, below + lows + len(inside)
    if rank < below or rank + 1 >= ends[-1] + (highs if low < high else 0):
        return None

    def of(rank: int) -> float:
        if rank < ends[1]:
            return low
        return float(inside[rank - ends[1]]) if rank < ends[2] else high

    return of(rank), of(rank + 1)


def _of_all(parts: Parts, total: int, rank: int) -> tuple[float, float]:
    """The same from all numbers."""
    numbers, done = array(total), 0
    for part in parts():
        numbers[done : done + len(part)] = part
        done += len(part)
    behind = min(rank + 1, total - 1)
    numbers.partition((rank, behind))
    return float(numbers[rank]), float(numbers[behind])


def runs_where(count: int, flags: Callable[[int, int], Flags], least: int) -> list[tuple[int, int]]:
    """First and end (excluded) of runs of flags of at least `least`; `flags` gives those of a
    block."""
    found: list[tuple[int, int]] = []
    begun, before = 0, False
    for low, high in blocks(count):
        here = flags(low, high)
        edges = np.flatnonzero(here != np.concatenate([[before], here[:-1]])) + low
        if before:
            edges = np.concatenate([[begun], edges])
        before = bool(here[-1])
        if before:
            begun, edges = int(edges[-1]), edges[:-1]
        found += _long(edges[::2], edges[1::2], least)
    return found + ([(begun, count)] if before and count - begun >= least else [])


def runs_of_same(values: Array, least: int) -> tuple[list[tuple[int, int]], int]:
    """Runs of equal numbers of at least `least`, first and end (excluded), and the length of the
    longest shorter run, at least 1."""
    found: list[tuple[int, int]] = []
    begun, shorter = 0, 1

    def enter(edges: np.ndarray) -> None:
        nonlocal shorter
        lengths = np.diff(edges)
        shorter = max(shorter, int(np.max(lengths, where=lengths < least, initial=1)))
        found.extend(_long(edges[:-1], edges[1:], least))

    for low, high in blocks(len(values), values):
        first = max(low, 1)
        with np.errstate(invalid="ignore"):
            changes = np.flatnonzero(values[first:high] != values[first - 1 : high - 1]) + first
        if len(changes):
            enter(np.concatenate([[begun], changes]))
            begun = int(changes[-1])
    enter(np.array([begun, len(values)]))
    return found, shorter


def _long(starts: np.ndarray, stops: np.ndarray, least: int) -> list[tuple[int, int]]:
    keep = stops - starts >= least
    return list(zip(starts[keep].tolist(), stops[keep].tolist(), strict=True))


def filled_blocks(values: Array, beside: int) -> Iterator[tuple[int, int, int, Array]]:
    """Blocks ``low : high`` with `beside` more numbers on both sides, beginning at `start`: low,
    high, start, numbers. Gaps hold the last reading; before the first there is NaN."""
    last, n = np.nan, len(values)
    for low, high in blocks(n):
        start, stop = max(low - beside, 0), min(high + beside, n)
        part = values[start:stop]
        known = np.isfinite(part)
        if known.all():
            filled = np.array(part)
        else:
            latest = np.maximum.accumulate(np.where(known, np.arange(len(part)), -1))
            filled = np.where(latest < 0, last, part[np.maximum(latest, 0)])
        let_go(values)
        yield low, high, start, filled
        behind = max(high - beside, 0) - 1
        if behind >= 0:
            last = float(filled[behind - start])


def interval_of(time: Array, unknown: float) -> float:
    """The median time between samples, s; `unknown` for fewer than two."""
    if len(time) < 2:
        return unknown
    return median_of(
        lambda: differences((time[low:high] for low, high in blocks(len(time), time)), 1)
    )


def sums_between(values: Array, first: np.ndarray, last: np.ndarray) -> Array:
    """Sums of the samples ``first : last`` of stretches in order of time, shape (n,)."""
    if not len(first):
        return np.zeros(0)
    edges = np.column_stack([first, last]).ravel()
    # A stretch that ends with the samples needs no edge.
    inside = edges[:-1] if edges[-1] == len(values) else edges
    sums: Array = np.add.reduceat(values, np.minimum(inside, len(values) - 1))[::2]
    return np.where(last > first, sums, 0.0)


def means_between(
    values: Array,
    first: np.ndarray,
    last: np.ndarray,
    usable: Callable[[Array], Array] = lambda values: values,
) -> tuple[Array, Array]:
    """Means of the samples ``first : last`` that have a reading, and the number of these.

    `usable` replaces unusable numbers by NaN. Stretches, in order of time, are taken in groups not
    longer than a block.
    """
    means, number = np.zeros((2, len(first)))
    low = 0
    while low < len(first):
        high = int(np.searchsorted(last, first[low] + limits.BLOCK, side="right"))
        high = max(high, low + 1)
        begin, stop = int(first[low]), int(last[high - 1])
        here = usable(values[begin:stop]), first[low:high] - begin, last[low:high] - begin
        means[low:high], number[low:high] = _means_at_once(*here)
        let_go(values)
        low = high
    return means, number


def _means_at_once(values: Array, first: np.ndarray, last: np.ndarray) -> tuple[Array, Array]:
    number = (last - first).astype(float)
    known = np.isfinite(values)
    if not known.all():
        number = sums_between(known.astype(float), first, last)
        values = np.where(known, values, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return sums_between(values, first, last) / number, number


def nearest(base: Array, own: Array) -> NDArray[np.intp]:
    """Index of the time of `base`, in order, nearest to each time of `own`."""
    behind = np.clip(np.searchsorted(base, own), 1, max(len(base) - 1, 1))
    before, behind = behind - 1, np.minimum(behind, len(base) - 1)
    return np.where(own - base[before] <= base[behind] - own, before, behind)
