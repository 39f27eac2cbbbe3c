"""Operation against a closed valve, where the flow is zero.

Many estimates of a flow are that flow times a ratio that is 1 without faults. At a flow of exactly
zero they reduce to 0 = 0 and determine no reading. Its limit exists, and is what the plant does
there. Readings are therefore predicted at a flow so small that no meter shows it.
"""

from __future__ import annotations

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.limits import COVERAGE
from rulec_runtime.recordings.reading_unit import parse_unit
from rulec_runtime.recordings.stationary import systematic_u

from rulec.simulation import limits

VOLUME_FLOW = (3.0, 0.0, -1.0, 0.0, 0.0)
"""Exponents of m, kg, s, K, A."""


def is_flow(signal: SignalSpec, ruleset: Ruleset) -> bool:
    """Whether a reading is a volume flow."""
    own = parse_unit(signal.unit, ruleset.units)
    return own is not None and own.dimension == VOLUME_FLOW


def without_flow(signal: SignalSpec, values: Array, ruleset: Ruleset) -> np.ndarray:
    """Flags of readings of a flow meter that show no flow, shape (n,); `values` are SI."""
    if not is_flow(signal, ruleset):
        return np.zeros(len(values), dtype=bool)
    tiny = limits.NO_FLOW * abs(signal.reference)
    zero = np.maximum(COVERAGE * systematic_u(signal, values), tiny)
    with np.errstate(invalid="ignore"):
        none: np.ndarray = (values < tiny) & (values >= -zero)
    return none


def nearly_shut(signal: SignalSpec, values: Array, ruleset: Ruleset) -> Array:
    """Readings in which the smallest flow replaces a flow of zero."""
    tiny = limits.NO_FLOW * abs(signal.reference)
    nearly: Array = np.where(without_flow(signal, values, ruleset), tiny, values)
    return nearly
