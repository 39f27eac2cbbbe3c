"""The range over which a law was tested: that of the points, widened to the sensor's error bound.

A sensor cannot distinguish two values within its 95 % bound. Where a reading varied less than that
in the calibration, the recording holds one value of it, known to that bound. A narrower range would
be left because of the sensor's error alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.limits import COVERAGE


@dataclass(frozen=True)
class CalibratedRange:
    """Ends in SI; `stood`: the reading varied no more than its sensor's error bound."""

    low: float
    high: float
    stood: bool


def range_of(values: Array, systematic: Array) -> CalibratedRange:
    """The range that readings at the points used cover, shapes (n,), n > 0."""
    low, high = float(values.min()), float(values.max())
    bound = COVERAGE * float(np.max(systematic))
    if high - low > 2.0 * bound:
        return CalibratedRange(low, high, False)
    middle = 0.5 * (low + high)
    return CalibratedRange(min(low, middle - bound), max(high, middle + bound), True)
