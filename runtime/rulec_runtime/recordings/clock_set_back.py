"""Rows in order of time, also where the clock of a recording was set back.

Rows that a program wrote out of order are sorted. A clock that was set back, as at the end of
summer time without a zone, repeats times: sorting would mix rows from before and after. There the
order of rows stays, and later times are shifted.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.columns import runs_of_same


@dataclass(frozen=True)
class ClockSet:
    """At a time of the recording, s, the clock was set back by `seconds`; or from then on, each of
    `times` stands at many rows, `rows` in all."""

    time: float
    seconds: float
    rows: int = 0
    times: int = 0


@dataclass(frozen=True)
class Ordered:
    """Rows in order of time.

    `order` are the rows if they were out of order, else None; `time` are their times, s, which
    never decrease; `sets` are changes of the clock.
    """

    order: NDArray[np.intp] | None
    time: Array
    sets: tuple[ClockSet, ...]


def in_order(time: Array) -> Ordered:
    """Put rows in order; each has a time."""
    back = np.flatnonzero(time[1:] < time[:-1]) + 1
    same, _ = runs_of_same(time, limits.CLOCK_STOOD)
    rows, times = sum(b - a for a, b in same), len(same)
    stood = (ClockSet(float(time[same[0][0]]), 0.0, rows, times),) if same else ()
    if not len(back):
        return Ordered(None, time, stood)
    runs = list(pairwise([0, *back.tolist(), len(time)]))
    many = len(time) < limits.ROWS_PER_STEP_BACK * len(back)
    if many or not any(_set(time, a, b) for a, b in pairwise(runs)):
        order = np.argsort(time, kind="stable")
        return Ordered(order, time[order], stood)
    usual = float(np.median(np.diff(time)))
    moved, sets = time.copy(), []
    for before, here in pairwise(runs):
        start, end = time[here[0]], time[before[1] - 1]
        moved[here[0] : here[1]] += moved[before[1] - 1] + usual - start
        sets.append(ClockSet(float(moved[here[0]]), float(end + usual - start)))
    return Ordered(None, moved, (*stood, *sets))


def _set(time: Array, before: tuple[int, int], here: tuple[int, int]) -> bool:
    """Whether the clock was set between two ordered runs of rows."""
    first, second = time[slice(*before)], time[slice(*here)]
    if second[-1] < first[0]:
        return bool(first[0] - second[-1] > limits.CLOCK_LOST * (np.ptp(first) + np.ptp(second)))
    twice = min(int((first >= second[0]).sum()), int((second <= first[-1]).sum()))
    return twice >= limits.WRITTEN_TWICE
