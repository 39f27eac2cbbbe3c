"""Errors of sensors: what a sensor shows of a value.

The systematic error of a sensor is one draw per recording from a normal distribution with the
standard uncertainty of its class; the statistical one is new in every sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.limits import COVERAGE, STATISTICAL_SHARE
from rulec_runtime.recordings.stationary import systematic_u


@dataclass(frozen=True)
class SensorErrors:
    """How large sensor errors are.

    `statistical` is their standard deviation as share of the systematic standard uncertainty.
    `bounded` keeps systematic errors inside the bounds of their sensor class, where the normal
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
    """Readings of one recording.

    Parameters
    ----------
    values : per signal id an array, shape (n,), SI, as a perfect sensor would show it.
    gains : factor that a fault in a sensor puts on its reading, shape (n,); it scales the errors
        of the sensor too, as in the seed paper, where the reading is multiplied.

    Returns
    -------
    Per signal id an array, shape (n,), SI. Equal generators give equal readings.
    """
    readings = {}
    for signal in ruleset.signals:
        if signal.id not in values:
            continue
        true = values[signal.id]
        shared = _normal(random, COVERAGE if errors.bounded else np.inf)
        own = errors.statistical * random.standard_normal(len(true))
        gain = (gains or {}).get(signal.id, 1.0)
        readings[signal.id] = true + gain * systematic_u(signal, true) * (shared + own)
    return readings


def _normal(random: np.random.Generator, bound: float) -> float:
    """A standard normal number within a bound; those beyond are drawn again."""
    while True:
        drawn = float(random.standard_normal())
        if abs(drawn) <= bound:
            return drawn
