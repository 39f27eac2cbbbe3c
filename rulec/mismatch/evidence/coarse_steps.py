"""Readings that move in coarse steps."""

from __future__ import annotations

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence import limits


def coarse_step(values: Array, u: float) -> float:
    """The step in which a reading moves, where that is far beyond its uncertainty `u`; else 0."""
    known = values[np.isfinite(values)]
    levels = np.unique(known)
    if not limits.COARSE_LEVELS <= len(levels) <= len(known) / limits.COARSE_SHOWN:
        return 0.0
    step = float(np.min(np.diff(levels)))
    even = np.abs(np.diff(levels) / step - np.round(np.diff(levels) / step)) < limits.COARSE_UNEVEN
    return step if step > limits.COARSE_BEYOND * u and even.all() else 0.0
