"""A curve as a line of characters."""

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array

LEVELS = "▁▂▃▄▅▆▇█"
COLUMNS = 32


def sparkline(at: Array, value: Array) -> str:
    """A curve over an increasing variable, both of shape (n,); its lowest level is its smallest
    value or 0, its highest its largest or 0.

    >>> sparkline(np.array([0.0, 1.0]), np.array([0.0, 0.2]))
    '▁▁▁▂▂▂▂▃▃▃▃▃▄▄▄▄▅▅▅▅▆▆▆▆▆▇▇▇▇███'
    """
    columns = np.interp(np.linspace(at[0], at[-1], COLUMNS), at, value)
    low, high = min(float(columns.min()), 0.0), max(float(columns.max()), 0.0)
    share = (columns - low) / max(high - low, limits.LEAST_U)
    return "".join(LEVELS[round(float(x) * (len(LEVELS) - 1))] for x in share)
