"""Readings that stand still to the last digit while the sensor should show its noise."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.piecewise import (
    Parts,
    differences,
    first_reading,
    parts_of,
    runs_of_same,
)
from rulec_runtime.recordings.robust import white_noise_of
from rulec_runtime.recordings.scratch import blocks


def standing_still(
    values: Array, u: float = np.inf, ends: tuple[float | None, float | None] = (None, None)
) -> list[tuple[int, int]]:
    """Spans, first and behind last, in which a reading with noise does not move at all.

    A plant at rest, a coarse display or a set value that is held shows the same for long as well;
    so what is noisy elsewhere alone is judged, by how long it stays the same there. For a reading
    that is given, `u`, the standard uncertainty of its class, tells noise from what was set. At the
    `ends` of its range a reading stands still for another reason.
    """
    long, chance = runs_of_same(values, limits.STILL_RUN)
    if not long or not _restless(partial(_beside, values, long), u):
        return []
    least = limits.STILL_TIMES * chance
    long = [run for run in long if run[1] - run[0] >= least and _moves_beside(values, *run)]
    return [run for run in long if not _clipped(values, *run, ends)]


def _moves_beside(values: Array, first: int, behind: int) -> bool:
    """Does a reading move from sample to sample right before and behind, as long as it stood?

    Noise changes with the operating point; what hides below the last digit there as well is no
    standstill.
    """
    long = behind - first
    for beside in (values[max(first - long, 0) : first], values[behind : behind + long]):
        count, same = _steps(parts_of(beside))
        if count >= limits.STILL_RUN and same / count > limits.REPEATED:
            return False
    return True


def _steps(parts: Iterable[Array]) -> tuple[int, int]:
    """How many steps there are from number to number, and how many of zero."""
    count = same = 0
    for steps in differences(parts, 1):
        count, same = count + len(steps), same + int((steps == 0).sum())
    return count, same


def _beside(values: Array, long: Sequence[tuple[int, int]]) -> Iterator[Array]:
    """Readings that are in none of some runs."""
    edges = np.array(long).reshape(-1, 2)
    for low, high in blocks(len(values), values):
        there = np.isfinite(values[low:high])
        for first, behind in edges[(edges[:, 0] < high) & (edges[:, 1] > low)].tolist():
            there[max(first - low, 0) : behind - low] = False
        yield values[low:high][there]


def _clipped(
    values: Array, first: int, behind: int, ends: tuple[float | None, float | None]
) -> bool:
    """Is it the end of what is shown? There noise comes back to the very same value."""
    level, (low, high) = values[first], ends
    if (low is not None and level <= low) or (high is not None and level >= high):
        return True
    same, smallest, largest = -(behind - first), np.inf, -np.inf
    for part in parts_of(values):
        same += int((part == level).sum())
        smallest = min(smallest, part.min(initial=np.inf))
        largest = max(largest, part.max(initial=-np.inf))
    return same > 0 and bool(level in (smallest, largest))


def _restless(rest: Parts, u: float) -> bool:
    """Has a reading noise, and no more of it than its class, where it does not stand still?"""
    count, same = _steps(rest())
    if count + 1 < 2 * limits.STILL_RUN or same / count > limits.REPEATED:
        return False
    noise, finer = (
        white_noise_of(partial(_differences_of, rest, order), order) for order in (3, 4)
    )
    white = noise >= limits.RESTLESS * _least_step(rest()) and finer >= limits.RESTLESS * noise
    return bool(white and noise <= limits.INSTRUMENT_NOISE * u)


def never_moves(values: Array) -> bool:
    """Is a reading the same from the first sample to the last?"""
    level, count = first_reading(values), 0
    for part in parts_of(values):
        if (part != level).any():
            return False
        count += len(part)
    return count >= limits.NEVER_MOVED


def last_digit(value: float) -> float:
    """The step in which a number is written, by its digits: 1.80 may be one of 1.8, 900 of 900.

    >>> last_digit(1.8), round(last_digit(1.82466), 9), last_digit(900.0), last_digit(0.0)
    (0.1, 1e-05, 100.0, 1.0)
    """
    for power in range(6, -12, -1):
        step = 10.0**power
        if (
            value
            and abs(value / step - round(value / step)) < limits.WRITTEN_DIGIT
            and round(value / step)
        ):
            return float(f"1e{power}")
    return 1.0


def _differences_of(parts: Parts, order: int) -> Iterator[Array]:
    return differences(parts(), order)


def _least_step(parts: Iterable[Array]) -> float:
    levels = np.zeros(0)
    for part in parts:
        levels = np.union1d(levels, part)
    steps = np.diff(levels)
    return float(np.quantile(steps, limits.FINEST_STEPS)) if len(steps) else np.inf
