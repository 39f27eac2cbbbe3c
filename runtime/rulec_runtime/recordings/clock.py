"""The order of rows, and a clock that was set while it recorded.

Rows that stand in another order than their times are sorted; a file may be written so. A clock
that was set back, as at the end of summer time without a zone, writes times twice: sorting would
mix what was before with what came after. There the order of rows holds, and times behind move on.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.plan import Array

SELDOM = 20
"""Rows per step back, on average, below which rows are out of order and no clock was set."""

TWICE = 3
"""Rows on both sides of a step back that have the same times: two rows may have changed places."""

LONG_AGO = 10.0
"""A step back by so many times what was recorded is a clock that lost its time, not a block of
rows written late."""

STOOD = 20
"""Rows in a row with the very same time that a clock stood still for; fewer are a fast logger."""


@dataclass(frozen=True)
class ClockSet:
    """The clock at a time of the recording, s: set back by `seconds`, or it stood for `rows`."""

    time: float
    seconds: float
    rows: int = 0


@dataclass(frozen=True)
class Ordered:
    """`order` are rows in order, `time` their times, s, which increase or stay; `sets` says when
    the clock was set, `sorted` whether rows were not in order."""

    order: NDArray[np.intp]
    time: Array
    sets: tuple[ClockSet, ...]
    sorted: bool


def in_order(time: Array) -> Ordered:
    """Put rows, all with a time, in order."""
    back = np.flatnonzero(np.diff(time) < 0) + 1
    stood = tuple(_standing(time))
    if not len(back):
        return Ordered(np.arange(len(time)), time, stood, False)
    starts = [0, *back.tolist(), len(time)]
    runs = list(pairwise(starts))
    if len(time) < SELDOM * len(back) or not any(_set(time, a, b) for a, b in pairwise(runs)):
        order = np.argsort(time, kind="stable")
        return Ordered(order, time[order], stood, True)
    usual = float(np.median(np.diff(time)))
    moved, sets = time.copy(), []
    for before, here in pairwise(runs):
        start, end = time[here[0]], time[before[1] - 1]
        shift = moved[before[1] - 1] + usual - start
        moved[here[0] : here[1]] += shift
        sets.append(ClockSet(float(moved[here[0]]), float(end + usual - start)))
    return Ordered(np.arange(len(time)), moved, (*stood, *sets), False)


def _set(time: Array, before: tuple[int, int], here: tuple[int, int]) -> bool:
    """Was the clock set between two runs of rows that are in order?"""
    first, second = time[slice(*before)], time[slice(*here)]
    if second[-1] < first[0]:
        return bool(first[0] - second[-1] > LONG_AGO * (np.ptp(first) + np.ptp(second)))
    twice = min(int((first >= second[0]).sum()), int((second <= first[-1]).sum()))
    return twice >= TWICE


def _standing(time: Array) -> list[ClockSet]:
    edges = np.concatenate([[0], np.flatnonzero(np.diff(time) != 0) + 1, [len(time)]])
    return [
        ClockSet(float(time[a]), 0.0, int(b - a))
        for a, b in pairwise(edges.tolist())
        if b - a >= STOOD
    ]
