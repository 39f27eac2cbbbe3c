"""A curve as a line of characters."""

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array

LEVELS = "▁▂▃▄▅▆▇█"
COLUMNS = 32


def sparkline(at: Array, value: Array) -> str:
    """Values of at least 0 over an increasing variable, both of shape (n,): from 0 to the largest.

    >>> sparkline(np.array([0.0, 1.0]), np.array([0.0, 0.2]))
    '▁▁▁▂▂▂▂▃▃▃▃▃▄▄▄▄▅▅▅▅▆▆▆▆▆▇▇▇▇███'
    """
    columns = np.interp(np.linspace(at[0], at[-1], COLUMNS), at, value)
    share = columns / max(float(columns.max()), limits.LEAST_U)
    return "".join(LEVELS[round(float(x) * (len(LEVELS) - 1))] for x in share)
