"""Drives with a memory: play, and a limited rate. Readings and set values by sample."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..units import Array


def with_play(value: Array, width: float) -> Array:
    """A pointer with play: it moves when pushed only.

    Source: Prandtl's play operator.
    """
    result, pointer = np.empty_like(value), float(value[0])
    for i, pushed in enumerate(value.tolist()):
        pointer = min(max(pointer, pushed - 0.5 * width), pushed + 0.5 * width)
        result[i] = pointer
    return result


@dataclass(frozen=True)
class Path:
    """Where a drive is: straight between corners, or a step at each; before the first at rest."""

    times: Sequence[float]
    values: Sequence[float]
    stepped: bool

    def at(self, time: float) -> float:
        """Where it is; where it steps, behind the step."""
        i = bisect_right(self.times, time) - 1
        if i < 0:
            return self.values[0]
        if self.stepped or i == len(self.times) - 1:
            return self.values[i]
        share = (time - self.times[i]) / (self.times[i + 1] - self.times[i])
        return self.values[i] + share * (self.values[i + 1] - self.values[i])


def path(time: Array, wanted: Array, rate: float) -> Path:
    """Where a drive is that moves at a `rate` at most to what each sample wants."""
    if math.isinf(rate):
        return Path(time.tolist(), wanted.tolist(), stepped=True)
    here = float(wanted[0])
    times, values = [float(time[0])], [here]
    for i in range(len(time) - 1):
        begin, end = float(time[i]), float(time[i + 1])
        goal = float(wanted[i])
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
