"""A course as one row of characters."""

from __future__ import annotations

import numpy as np
from rulec_runtime.contract.plan import Array

LEVELS = "▁▂▃▄▅▆▇█"


def sparkline(values: Array, width: int) -> str:
    """A course, shape (n,), in so many characters at most; a gap where nothing is known.

    >>> sparkline(np.array([0.0, 1.0, 2.0, np.nan, 7.0]), 5)
    '▁▂▃ █'
    """
    parts = np.array_split(values, max(1, min(width, len(values))))
    means = [_mean(part) for part in parts]
    seen = [m for m in means if np.isfinite(m)]
    if not seen:
        return ""
    low, span = min(seen), max(seen) - min(seen)
    top = len(LEVELS) - 1
    return "".join(
        LEVELS[round(top * (m - low) / span) if span > 0 else 0] if np.isfinite(m) else " "
        for m in means
    )


def _mean(part: Array) -> float:
    sound = part[np.isfinite(part)]
    return float(sound.mean()) if len(sound) else np.nan
