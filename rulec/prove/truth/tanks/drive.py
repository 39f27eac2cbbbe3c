"""Inputs of a plant from 0 to 1 of the highest, one value per sample; drives that follow them with
play, or at a limited rate.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..smooth import held
from ..units import Array

LOWEST = 0.3
"""Least share of the highest input in operation."""


def steps(random: np.random.Generator, samples: int) -> Array:
    """Random values, each held for 10 to 60 samples."""
    return held(random, samples, 10, 60, lambda: float(random.uniform(LOWEST, 1.0)))


def multisine(random: np.random.Generator, samples: int) -> Array:
    """Eight slow sines with random phase, and a few steps on top."""
    time = np.arange(samples)
    period = np.geomspace(25.0, max(0.4 * samples, 60.0), 8)
    phase = random.uniform(0.0, 2.0 * np.pi, 8)
    waves: Array = np.sum(np.sin(2.0 * np.pi * time[:, None] / period + phase), axis=1)
    on_top = held(random, samples, 10, 60, lambda: float(random.choice([-0.2, 0.0, 0.0, 0.2])))
    return np.asarray(np.clip(0.62 + 0.16 * waves / waves.std() + on_top, 0.1, 1.0))


def ramps(random: np.random.Generator, samples: int) -> Array:
    """Straight lines between random values, 20 to 80 samples apart."""
    corners = np.cumsum([0, *random.integers(20, 80, samples // 20 + 1)])
    values = random.uniform(LOWEST, 1.0, len(corners))
    return np.asarray(np.interp(np.arange(samples), corners, values))


def start_stop(random: np.random.Generator, samples: int) -> Array:
    """On for 25 to 70 samples at a random value, off for 5 to 20."""
    result, begin = np.zeros(samples), 0
    while begin < samples:
        end = begin + int(random.integers(25, 70))
        result[begin:end] = random.uniform(0.5, 1.0)
        begin = end + int(random.integers(5, 20))
    return result


def plateaus(random: np.random.Generator, samples: int) -> Array:
    """A few values only, each held for a long time, so that the plant settles."""
    count = int(random.integers(4, 8))
    values = random.uniform(LOWEST, 1.0, count)
    lengths = random.uniform(0.6, 1.4, count)
    begins = np.cumsum(lengths / lengths.sum()) * samples
    return np.asarray(values[np.searchsorted(begins[:-1], np.arange(samples), "right")])


def few_values(random: np.random.Generator, samples: int) -> Array:
    """Three to five values in random order, each held for 30 to 80 samples at a time."""
    values = random.uniform(LOWEST, 1.0, int(random.integers(3, 6)))
    result, begin, last = np.empty(samples), 0, -1
    while begin < samples:
        last = int(random.choice([i for i in range(len(values)) if i != last]))
        end = begin + int(random.integers(30, 81))
        result[begin:end] = values[last]
        begin = end
    return result


PROFILES: Mapping[str, Callable[[np.random.Generator, int], Array]] = {
    "steps": steps,
    "multisine": multisine,
    "ramps": ramps,
    "start-stop": start_stop,
    "plateaus": plateaus,
    "few-values": few_values,
}

DRAWN = ("steps", "multisine", "ramps", "start-stop")
"""One of these is drawn if no profile is given."""


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
