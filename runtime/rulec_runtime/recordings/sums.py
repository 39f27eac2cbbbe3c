"""Sums and means of the samples of stretches."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.scratch import let_go


def sums_between(values: Array, first: np.ndarray, last: np.ndarray) -> Array:
    """Sums of the samples ``first : last``, of stretches in order of time, shape (n,)."""
    if not len(first):
        return np.zeros(0)
    edges = np.column_stack([first, last]).ravel()
    # What ends with the samples needs no edge.
    inside = edges[:-1] if edges[-1] == len(values) else edges
    sums: Array = np.add.reduceat(values, np.minimum(inside, len(values) - 1))[::2]
    return np.where(last > first, sums, 0.0)


def means_between(
    values: Array,
    first: np.ndarray,
    last: np.ndarray,
    usable: Callable[[Array], Array] = lambda values: values,
) -> tuple[Array, Array]:
    """Means of the samples ``first : last`` that have a reading, and how many these are.

    `usable` makes numbers of them that do not count NaN.
    """
    means, number = np.zeros((2, len(first)))
    for low, high in _near(first, last):
        begin, stop = int(first[low]), int(last[high - 1])
        here = usable(values[begin:stop]), first[low:high] - begin, last[low:high] - begin
        means[low:high], number[low:high] = _means_at_once(*here)
        let_go(values)
    return means, number


def _near(first: np.ndarray, last: np.ndarray) -> Iterator[tuple[int, int]]:
    """Stretches, in order of time, in groups that are not longer than a block."""
    low = 0
    while low < len(first):
        high = int(np.searchsorted(last, first[low] + limits.BLOCK, side="right"))
        high = max(high, low + 1)
        yield low, high
        low = high


def _means_at_once(values: Array, first: np.ndarray, last: np.ndarray) -> tuple[Array, Array]:
    number = (last - first).astype(float)
    known = np.isfinite(values)
    if not known.all():
        number = sums_between(known.astype(float), first, last)
        values = np.where(known, values, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return sums_between(values, first, last) / number, number
