"""Operation against a closed valve: a flow of zero, near which the equations go on.

Many estimates of a flow are that flow times a ratio that is 1 where all is well. At a flow of
exactly zero they say 0 = 0, and a reading that follows from them has no value; its limit has one,
and that is what the plant does there. So it is predicted at a flow so small that no meter shows it.
"""

from __future__ import annotations

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.limits import COVERAGE
from rulec_runtime.recordings.reading_unit import parse_unit
from rulec_runtime.recordings.stationary import systematic_u

from rulec import limits

VOLUME_FLOW = (3.0, 0.0, -1.0, 0.0, 0.0)
"""Exponents of m, kg, s, K, A."""


def is_flow(signal: SignalSpec, ruleset: Ruleset) -> bool:
    """Whether a reading is a volume flow."""
    own = parse_unit(signal.unit, ruleset.units)
    return own is not None and own.dimension == VOLUME_FLOW


def without_flow(signal: SignalSpec, values: Array, ruleset: Ruleset) -> np.ndarray:
    """Readings of a flow meter that show none, shape (n,); `values` are SI."""
    if not is_flow(signal, ruleset):
        return np.zeros(len(values), dtype=bool)
    tiny = limits.NO_FLOW * abs(signal.reference)
    zero = np.maximum(COVERAGE * systematic_u(signal, values), tiny)
    with np.errstate(invalid="ignore"):
        none: np.ndarray = (values < tiny) & (values >= -zero)
    return none


def nearly_shut(signal: SignalSpec, values: Array, ruleset: Ruleset) -> Array:
    """Readings with the smallest flow in the place of none."""
    tiny = limits.NO_FLOW * abs(signal.reference)
    nearly: Array = np.where(without_flow(signal, values, ruleset), tiny, values)
    return nearly
