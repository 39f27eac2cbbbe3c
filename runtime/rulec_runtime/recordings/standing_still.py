"""Find readings that stay constant to the last digit although the sensor should show noise."""

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
    beside = np.isfinite(values)
    for first, behind in long:
        beside[first:behind] = False
    if not long or not _restless(values[beside], u):
        return []
    long = [run for run in long if run[1] - run[0] >= limits.STILL_TIMES * chance]
    return [run for run in long if _moves_beside(values, *run) and not _clipped(values, *run, ends)]


def _moves_beside(values: Array, first: int, behind: int) -> bool:
    """Whether a reading moves from sample to sample just before and after, for as long as it stood.

    Noise depends on the operating point; if it hides below the last digit there too, the reading
    works.
    """
    long = behind - first
    parts = values[max(first - long, 0) : first], values[behind : behind + long]
    finite = [part[np.isfinite(part)] for part in parts]
    return not any(len(k) > limits.STILL_RUN and _repeated(k) > limits.REPEATED for k in finite)


def _repeated(readings: Array) -> float:
    """Share of readings that repeat the one before."""
    return float(np.mean(np.diff(readings) == 0))


def _clipped(
    values: Array, first: int, behind: int, ends: tuple[float | None, float | None]
) -> bool:
    """Whether a span is at an end of the range, where noise returns to exactly the same value."""
    level, (low, high) = values[first], ends
    if (low is not None and level <= low) or (high is not None and level >= high):
        return True
    finite = values[np.isfinite(values)]
    same = int((finite == level).sum()) - (behind - first)
    return same > 0 and bool(level in (finite.min(), finite.max()))


def _restless(rest: Array, u: float) -> bool:
    """Whether the other readings show white noise, and not more than their class."""
    if len(rest) < 2 * limits.STILL_RUN or _repeated(rest) > limits.REPEATED:
        return False
    steps = np.diff(np.unique(rest))
    least = float(np.quantile(steps, limits.FINEST_STEPS)) if len(steps) else np.inf
    noise, finer = (white_noise(np.diff(rest, order), order) for order in (3, 4))
    white = noise >= limits.RESTLESS * least and finer >= limits.RESTLESS * noise
    return bool(white and noise <= limits.INSTRUMENT_NOISE * u)


def never_moves(values: Array) -> bool:
    """Whether a reading is constant from the first sample to the last."""
    finite = values[np.isfinite(values)]
    return len(finite) >= common.NEVER_MOVED and bool((finite == finite[0]).all())


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
