"""The range over which a law was tested: what the points covered, and no less than a sensor sees.

Within its 95 % bound a sensor does not tell two values apart. Where a reading moved less than that
in the calibration, the recording says one value of it, known to the bound: a guard that is narrower
would fire on the sensor's own error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.limits import COVERAGE


@dataclass(frozen=True)
class CalibratedRange:
    """Ends in SI; `stood` tells that the reading moved no more than its sensor's bound allows."""

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
