"""Readings that stand still while the sensor should show its noise, or move in coarse steps."""

from __future__ import annotations

import numpy as np

from runtime.plan import Array

LONGEST, TIMES = 10, 5.0
"""Readings that are all the same: so many at least, and so many times the longest chance run."""

RESTLESS = 0.7
"""Scatter of third differences, in least steps, from which on a reading has noise of its own; a
smooth course that is rounded has a third."""

FEWEST, SHOWN, BEYOND, UNEVEN = 4, 8, 5.0, 0.1
"""Levels of a coarse display at least, and readings of each, on average; its step at least, in
standard uncertainties of its class; and how far a level may be off the others' raster, in steps."""


def standing_still(values: Array) -> list[tuple[int, int]]:
    """Spans, first and behind last, in which a reading with noise does not move at all.

    A plant at rest, or a coarse display, shows the same for long as well; so what is noisy
    elsewhere alone is judged, by how long it stays the same there.
    """
    runs = _runs(values)
    long = [run for run in runs if run[1] - run[0] >= LONGEST]
    if not long:
        return []
    still = np.zeros(len(values), dtype=bool)
    for first, behind in long:
        still[first:behind] = True
    rest = values[~still]
    rest = rest[np.isfinite(rest)]
    if len(rest) < 2 * LONGEST or _noise(rest) < RESTLESS * _least_step(rest):
        return []
    chance = max((b - a for a, b in runs if b - a < LONGEST), default=1)
    ends = (np.nanmin(values), np.nanmax(values))
    # At the end of its range a reading stands still for another reason.
    free = [run for run in long if values[run[0]] not in ends]
    return [run for run in free if run[1] - run[0] >= TIMES * chance]


def _noise(values: Array) -> float:
    return 1.4826 * float(np.median(np.abs(np.diff(values, 3)))) / float(np.sqrt(20.0))


def _least_step(values: Array) -> float:
    steps = np.diff(np.unique(values))
    return float(np.median(steps)) if len(steps) else np.inf


def coarse_step(values: Array, u: float) -> float:
    """The step in which a reading moves, where that is far beyond its uncertainty `u`; else 0."""
    known = values[np.isfinite(values)]
    levels = np.unique(known)
    if not FEWEST <= len(levels) <= len(known) / SHOWN:
        return 0.0
    step = float(np.min(np.diff(levels)))
    even = np.abs(np.diff(levels) / step - np.round(np.diff(levels) / step)) < UNEVEN
    return step if step > BEYOND * u and even.all() else 0.0


def _runs(values: Array) -> list[tuple[int, int]]:
    """Spans of equal readings, first and behind last."""
    with np.errstate(invalid="ignore"):
        changes = np.flatnonzero(np.diff(values) != 0) + 1
    edges = np.concatenate([[0], changes, [len(values)]])
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
