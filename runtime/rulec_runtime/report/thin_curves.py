"""Long series made short enough to draw, without losing an extreme.

A picture has some hundreds of columns. Of all samples in a column the smallest and the largest
value are kept; what a pixel cannot show is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array

COLUMNS = 600
"""Columns of a picture; a series keeps at most two points a column."""


@dataclass(frozen=True)
class Columns:
    """Which column each sample belongs to; `first` starts the samples of column `place`.

    Time and values are in order, so the samples of a column stand together.
    """

    centre: Array
    place: NDArray[np.intp]
    first: NDArray[np.intp]

    def lowest(self, values: Array) -> Array:
        """Smallest value per column, NaN where there is none; shape (columns,)."""
        return self._spread(np.fmin.reduceat(values, self.first))

    def highest(self, values: Array) -> Array:
        """Largest value per column, NaN where there is none; shape (columns,)."""
        return self._spread(np.fmax.reduceat(values, self.first))

    def _spread(self, values: Array) -> Array:
        result = np.full(len(self.centre), np.nan)
        result[self.place] = values
        return result


def columns_of(time: Array, count: int = COLUMNS) -> Columns:
    """Divide a time, shape (n,), increasing, into columns of equal width."""
    low, high = float(time[0]), float(time[-1])
    width = (high - low) / count or 1.0
    index = np.minimum(((time - low) / width).astype(np.intp), count - 1)
    place, first = np.unique(index, return_index=True)
    centre: Array = np.asarray(low + width * (np.arange(count) + 0.5), dtype=float)
    return Columns(centre, place, first)


def thin_series(time: Array, values: Array) -> tuple[Array, Array]:
    """Time and values of a series, at most two points a column; NaN where it breaks."""
    if len(time) <= 2 * COLUMNS:
        return with_pauses(time, values)
    columns = columns_of(time)
    low, high = columns.lowest(values), columns.highest(values)
    odd = np.arange(COLUMNS) % 2 == 1
    # Up in one column, down in the next: no diagonal strokes across a column.
    pairs = np.stack([np.where(odd, high, low), np.where(odd, low, high)], axis=1)
    return np.repeat(columns.centre, 2), pairs.ravel()


def thin_band(time: Array, low: Array, high: Array) -> tuple[Array, Array, Array]:
    """Time, lower and upper edge of a band, at most one point a column."""
    if len(time) <= 2 * COLUMNS:
        spread, upper = with_pauses(time, high)
        return spread, with_pauses(time, low)[1], upper
    columns = columns_of(time)
    return columns.centre, columns.lowest(low), columns.highest(high)


def with_pauses(time: Array, values: Array) -> tuple[Array, Array]:
    """A series with a NaN in each long pause, so that no stroke bridges it."""
    if len(time) < 3:
        return time, values
    steps = np.diff(time)
    after = np.flatnonzero(steps > limits.PAUSE * np.median(steps)) + 1
    return np.insert(time, after, time[after - 1]), np.insert(values, after, np.nan)


def thin_marks(time: Array, size: Array, chosen: np.ndarray, count: int) -> NDArray[np.intp]:
    """Samples to mark: of the chosen ones in each of `count` columns the one of largest size."""
    index = np.flatnonzero(chosen & np.isfinite(size))
    if not len(index):
        return index
    low, high = float(time[0]), float(time[-1])
    share = (time[index] - low) / ((high - low) or 1.0)
    column = np.minimum((share * count).astype(np.intp), count - 1)
    order = np.lexsort((-size[index], column))
    _, first = np.unique(column[order], return_index=True)
    result: NDArray[np.intp] = index[order[first]]
    return result
