"""Readings that stand still to the last digit while the sensor should show its noise."""

from __future__ import annotations

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust import white_noise


def standing_still(
    values: Array, u: float = np.inf, ends: tuple[float | None, float | None] = (None, None)
) -> list[tuple[int, int]]:
    """Spans, first and behind last, in which a reading with noise does not move at all.

    A plant at rest, a coarse display or a set value that is held shows the same for long as well;
    so what is noisy elsewhere alone is judged, by how long it stays the same there. For a reading
    that is given, `u`, the standard uncertainty of its class, tells noise from what was set. At the
    `ends` of its range a reading stands still for another reason.
    """
    edges = _edges_of_equals(values)
    lengths = np.diff(edges)
    places = np.flatnonzero(lengths >= limits.STILL_RUN)
    if not len(places):
        return []
    long = list(zip(edges[places].tolist(), edges[places + 1].tolist(), strict=True))
    rest = values.copy()
    for first, behind in long:
        rest[first:behind] = np.nan
    if not _restless(rest, u):
        return []
    chance = int(np.max(lengths, where=lengths < limits.STILL_RUN, initial=1))
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
        steps = np.diff(beside[np.isfinite(beside)])
        if len(steps) >= limits.STILL_RUN and np.mean(steps == 0) > limits.REPEATED:
            return False
    return True


def _clipped(
    values: Array, first: int, behind: int, ends: tuple[float | None, float | None]
) -> bool:
    """Is it the end of what is shown? There noise comes back to the very same value."""
    level, (low, high) = values[first], ends
    if (low is not None and level <= low) or (high is not None and level >= high):
        return True
    again = int((values[:first] == level).sum() + (values[behind:] == level).sum())
    return again > 0 and bool(level in (np.nanmin(values), np.nanmax(values)))


def _restless(rest: Array, u: float) -> bool:
    """Has a reading noise, and no more of it than its class, where it does not stand still?"""
    known = rest[np.isfinite(rest)]
    if len(known) < 2 * limits.STILL_RUN or np.mean(np.diff(known) == 0) > limits.REPEATED:
        return False
    noise, finer = (white_noise(np.diff(known, order), order) for order in (3, 4))
    white = noise >= limits.RESTLESS * _least_step(known) and finer >= limits.RESTLESS * noise
    return bool(white and noise <= limits.INSTRUMENT_NOISE * u)


def never_moves(values: Array) -> bool:
    """Is a reading the same from the first sample to the last?"""
    known = values[np.isfinite(values)]
    return len(known) >= limits.NEVER_MOVED and bool((known == known[0]).all())


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


def _least_step(values: Array) -> float:
    steps = np.diff(np.unique(values))
    return float(np.quantile(steps, limits.FINEST_STEPS)) if len(steps) else np.inf


def runs_of_equals(values: Array) -> list[tuple[int, int]]:
    """Spans of equal readings, first and behind last."""
    edges = _edges_of_equals(values)
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def _edges_of_equals(values: Array) -> np.ndarray:
    """Where spans of equal readings begin, and where the last one ends."""
    with np.errstate(invalid="ignore"):
        changes = np.flatnonzero(values[1:] != values[:-1]) + 1
    return np.concatenate([[0], changes, [len(values)]])
