"""Find readings that stay constant to the last digit although the sensor should show noise."""

from collections.abc import Sequence

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.columns import runs_of_same
from rulec_runtime.recordings.robust_statistics import white_noise


def standing_still(
    values: Array, u: float = np.inf, ends: tuple[float | None, float | None] = (None, None)
) -> list[tuple[int, int]]:
    """Spans, first and end (excluded), in which a noisy reading does not move at all.

    A plant at rest, a coarse display or a constant set value also repeat for long; so only readings
    with noise elsewhere are judged, by how long they repeat there. For an input, `u`, the standard
    uncertainty of its class, distinguishes noise from changes of the set value. At the `ends` of
    its range a reading repeats for another reason.
    """
    long, chance = runs_of_same(values, limits.STILL_RUN)
    if not long or not _restless(_beside(values, long), u):
        return []
    least = limits.STILL_TIMES * chance
    long = [run for run in long if run[1] - run[0] >= least and _moves_beside(values, *run)]
    return [run for run in long if not _clipped(values, *run, ends)]


def _moves_beside(values: Array, first: int, behind: int) -> bool:
    """Whether a reading moves from sample to sample just before and after, for as long as it stood.

    Noise depends on the operating point; if it hides below the last digit there too, the reading
    works.
    """
    long = behind - first
    for beside in (values[max(first - long, 0) : first], values[behind : behind + long]):
        count, same = _steps(beside[np.isfinite(beside)])
        if count >= limits.STILL_RUN and same / count > limits.REPEATED:
            return False
    return True


def _steps(readings: Array) -> tuple[int, int]:
    """Number of steps from number to number, and number of zero steps."""
    steps = np.diff(readings)
    return len(steps), int((steps == 0).sum())


def _beside(values: Array, long: Sequence[tuple[int, int]]) -> Array:
    """Readings outside the runs `long`."""
    there = np.isfinite(values)
    for first, behind in long:
        there[first:behind] = False
    return values[there]


def _clipped(
    values: Array, first: int, behind: int, ends: tuple[float | None, float | None]
) -> bool:
    """Whether a span is at an end of the range, where noise returns to exactly the same value."""
    level, (low, high) = values[first], ends
    if (low is not None and level <= low) or (high is not None and level >= high):
        return True
    known = values[np.isfinite(values)]
    same = int((known == level).sum()) - (behind - first)
    return same > 0 and bool(level in (known.min(), known.max()))


def _restless(rest: Array, u: float) -> bool:
    """Whether the other readings show white noise, and not more than their class."""
    count, same = _steps(rest)
    if count + 1 < 2 * limits.STILL_RUN or same / count > limits.REPEATED:
        return False
    noise, finer = (white_noise(np.diff(rest, order), order) for order in (3, 4))
    white = noise >= limits.RESTLESS * _least_step(rest) and finer >= limits.RESTLESS * noise
    return bool(white and noise <= limits.INSTRUMENT_NOISE * u)


def never_moves(values: Array) -> bool:
    """Whether a reading is constant from the first sample to the last."""
    known = values[np.isfinite(values)]
    return len(known) >= common.NEVER_MOVED and bool((known == known[0]).all())


def last_digit(value: float) -> float:
    """The step in which a number is written, by its digits: 0.1 for 1.80, 100 for 900.

    >>> last_digit(1.8), round(last_digit(1.82466), 9), last_digit(900.0), last_digit(0.0)
    (0.1, 1e-05, 100.0, 1.0)
    """
    for power in range(6, -12, -1):
        steps = value / 10.0**power
        if round(steps) and abs(steps - round(steps)) < limits.WRITTEN_DIGIT:
            return float(f"1e{power}")
    return 1.0


def _least_step(readings: Array) -> float:
    steps = np.diff(np.unique(readings))
    return float(np.quantile(steps, limits.FINEST_STEPS)) if len(steps) else np.inf
