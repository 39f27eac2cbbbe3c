"""Thin long series for drawing without losing an extreme.

A picture has some hundreds of columns. Each column keeps the smallest and the largest value of its
samples; a pixel cannot show more.
"""

import numpy as np
from numpy.typing import NDArray

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array

COLUMNS = 600
"""Columns of a picture; a series keeps at most two points per column."""


CELLS, CELL = 160, 2.5
"""Cells across a scatter plot, and their height in pixels; one point per cell."""


def is_long(time: Array) -> bool:
    """Whether a series, shape (n,), has more samples than a picture can show."""
    return len(time.T) > 2 * COLUMNS


def cells_of(across: Array, down: Array) -> NDArray[np.intp]:
    """The first point in each cell of a panel, shape (cells,); positions, shape (n,), are shares of
    its width and pixels."""
    finite = np.flatnonzero(np.isfinite(across) & np.isfinite(down))
    cells = np.floor(np.stack([across[finite] * CELLS, down[finite] / CELL]))
    first = np.unique(cells, axis=1, return_index=True)[1]
    result: NDArray[np.intp] = finite[np.sort(first)]
    return result


def extremes(time: Array, low: Array, high: Array) -> tuple[Array, Array, Array]:
    """Centres of columns of equal width over a time, shape (n,), increasing; per column the
    smallest value of `low` and the largest of `high`, NaN for an empty one."""
    begin, end = float(time[0]), float(time[-1])
    width = (end - begin) / COLUMNS or 1.0
    index = np.minimum(((time - begin) / width).astype(np.intp), COLUMNS - 1)
    cells, first = np.unique(index, return_index=True)
    lowest, highest = np.full((2, COLUMNS), np.nan)
    lowest[cells] = np.fmin.reduceat(low, first)
    highest[cells] = np.fmax.reduceat(high, first)
    centre: Array = np.asarray(begin + width * (np.arange(COLUMNS) + 0.5), dtype=float)
    return centre, lowest, highest


def thin_series(time: Array, values: Array) -> tuple[Array, Array]:
    """Time and values of a series, at most two points per column; NaN where it breaks."""
    if not is_long(time):
        return with_pauses(time, values)
    centre, low, high = extremes(time, values, values)
    odd = np.arange(COLUMNS) % 2 == 1
    # Alternate up and down, so that no diagonal stroke crosses a column.
    pairs = np.stack([np.where(odd, high, low), np.where(odd, low, high)], axis=1)
    return np.repeat(centre, 2), pairs.ravel()


def thin_band(time: Array, low: Array, high: Array) -> tuple[Array, Array, Array]:
    """Time, lower and upper edge of a band, at most one point per column."""
    if not is_long(time):
        spread, upper = with_pauses(time, high)
        return spread, with_pauses(time, low)[1], upper
    return extremes(time, low, high)


def thin_flags(time: Array, flags: np.ndarray) -> tuple[Array, np.ndarray]:
    """Time and flags; a column of a long series has the flag that any of its samples has."""
    if not is_long(time):
        return time, flags
    centre, _, highest = extremes(time, *[flags.astype(float)] * 2)
    return centre, highest > 0


def with_pauses(time: Array, values: Array) -> tuple[Array, Array]:
    """A series with NaN in each long pause, so that no stroke bridges it."""
    if len(time) < 3:
        return time, values
    steps = np.diff(time)
    after = np.flatnonzero(steps > limits.PAUSE * np.median(steps)) + 1
    return np.insert(time, after, time[after - 1]), np.insert(values, after, np.nan)


def thin_marks(time: Array, size: Array, chosen: np.ndarray, count: int) -> NDArray[np.intp]:
    """Samples to mark: the largest chosen one in each of `count` columns."""
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
