"""Readings with the errors of their sensors.

The systematic error of a sensor is one draw per recording from a normal distribution with the
standard uncertainty of its class; the statistical error is new in every sample.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.limits import COVERAGE, STATISTICAL_SHARE
from rulec_runtime.recordings.stationary import systematic_u


@dataclass(frozen=True)
class SensorErrors:
    """Size of sensor errors.

    `statistical` is their standard deviation as a share of the systematic standard uncertainty.
    `bounded` keeps systematic errors inside the bounds of their sensor class; the normal
    distribution leaves 5 % outside.
    """

    statistical: float = STATISTICAL_SHARE
    bounded: bool = False


def sense(
    ruleset: Ruleset,
    values: Mapping[str, Array],
    errors: SensorErrors,
    random: np.random.Generator,
    gains: Mapping[str, Array] | None = None,
) -> dict[str, Array]:
    """Readings of one recording by signal id, shape (n,), SI. Equal generators give equal readings.

    Parameters
    ----------
    values : an array per signal id, shape (n,), SI, as a perfect sensor would show it.
    gains : factors by which faults in sensors scale readings, shape (n,); they scale the errors of
        the sensors too, as in the seed paper, which multiplies the reading.
    """
    readings = {}
    for signal in ruleset.signals:
        if signal.id not in values:
            continue
        true = values[signal.id]
        shared = float(random.standard_normal())
        while errors.bounded and abs(shared) > COVERAGE:
            shared = float(random.standard_normal())
        own = errors.statistical * random.standard_normal(len(true))
        gain = (gains or {}).get(signal.id, 1.0)
        readings[signal.id] = true + gain * systematic_u(signal, true) * (shared + own)
    return readings
