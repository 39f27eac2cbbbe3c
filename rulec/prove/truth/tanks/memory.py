"""Drives with a memory: play, and a limited rate."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..units import Array


def with_play(value: Array, width: float) -> Array:
    """Return the course of a pointer with play, which moves only when pushed.

    Source: Prandtl's play operator.
    """
    result, pointer = np.empty_like(value), float(value[0])
    for i, pushed in enumerate(value.tolist()):
        pointer = min(max(pointer, pushed - 0.5 * width), pushed + 0.5 * width)
        result[i] = pointer
    return result


@dataclass(frozen=True)
class Path:
    """Position of a drive: linear between corners, or a step at each; at rest before the first."""

    times: Sequence[float]
    values: Sequence[float]
    stepped: bool

    def at(self, time: float) -> float:
        """Return the position; at a step, that after it."""
        i = bisect_right(self.times, time) - 1
        if i < 0:
            return self.values[0]
        if self.stepped or i == len(self.times) - 1:
            return self.values[i]
        share = (time - self.times[i]) / (self.times[i + 1] - self.times[i])
        return self.values[i] + share * (self.values[i + 1] - self.values[i])


def path(time: Array, wanted: Array, rate: float) -> Path:
    """Return the path of a drive that moves at most at a `rate` to the setting of each sample."""
    if math.isinf(rate):
        return Path(time.tolist(), wanted.tolist(), stepped=True)
    here = float(wanted[0])
    times, values = [float(time[0])], [here]
    for i in range(len(time) - 1):
        begin, end, goal = float(time[i]), float(time[i + 1]), float(wanted[i])
        arrival = begin + abs(goal - here) / rate
        if arrival < end:
            if arrival > begin:
                times.append(arrival)
                values.append(goal)
            here = goal
        else:
            here += math.copysign(rate * (end - begin), goal - here)
        times.append(end)
        values.append(here)
    return Path(times, values, stepped=False)
