"""Readings that move in coarse steps."""

from __future__ import annotations

import numpy as np

from rulec_runtime.contract.plan import Array

FEWEST, SHOWN, BEYOND, UNEVEN = 4, 8, 5.0, 0.1
"""Levels of a coarse display at least, and readings of each, on average; its step at least, in
standard uncertainties of its class; and how far a level may be off the others' raster, in steps."""


def coarse_step(values: Array, u: float) -> float:
    """The step in which a reading moves, where that is far beyond its uncertainty `u`; else 0."""
    known = values[np.isfinite(values)]
    levels = np.unique(known)
    if not FEWEST <= len(levels) <= len(known) / SHOWN:
        return 0.0
    step = float(np.min(np.diff(levels)))
    even = np.abs(np.diff(levels) / step - np.round(np.diff(levels) / step)) < UNEVEN
    return step if step > BEYOND * u and even.all() else 0.0
