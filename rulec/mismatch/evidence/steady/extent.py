"""How large readings are: from their zero, or where that is arbitrary, by how far they spread.

A share of a temperature means nothing: 5 % of 20 degC would be 15 kelvin. The knowledge base says
which quantities have such a zero (``scale: interval`` in units.yaml).
"""

from __future__ import annotations

import numpy as np

from rulec.knowledge.degree_unit import has_no_zero
from rulec.mismatch.evidence.steady.system import System


def zero_is_arbitrary(system: System, signal: str) -> bool:
    """Is the zero of a signal where somebody put it?"""
    module, _, name = signal.partition(".")
    plant = system.builder.network.plant
    return has_no_zero(plant.modules[module].type.signals[name], plant.knowledge.units)


def span(system: System, signal: str) -> float:
    """What a sensor can show, SI, or where nobody says it, what it showed."""
    low, high = system.ruleset.signal_by_id[signal].ends
    if np.isfinite(high - low):
        return high - low
    values = system.data.values[signal]
    return float(np.nanmax(values) - np.nanmin(values))
