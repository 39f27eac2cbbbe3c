"""Degrees that a search begins with: far from its start it may run into a pole of the law."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.fault_inversion import Faults


def usual_starts(hypotheses: Sequence[Faults]) -> Array:
    """Degrees tried first, shape (faults, starts, hypotheses, 1)."""
    if not hypotheses or len(hypotheses[0]) == 1:
        singles = [_single(faults) for faults in hypotheses]
        most = max(map(len, singles), default=1)
        # Zero comes first: once more it changes nothing.
        padded = [np.pad(s, (0, most - len(s))) for s in singles]
        return np.array(padded).reshape(1, len(padded), most, 1).transpose(0, 2, 1, 3)
    return pair_starts()


def _single(faults: Faults) -> Array:
    """Degrees of one fault tried first: zero and what is in its range."""
    (fault,) = faults
    low = fault.lowest / fault.scale
    top = fault.highest * (1.0 - limits.BELOW_HIGHEST) / fault.scale
    starts = np.array(limits.FIT_STARTS)
    tried: Array = starts[(starts == 0.0) | ((low < starts) & (top > starts))] * fault.scale
    return tried


def pair_starts() -> Array:
    """Degrees of two faults tried first, shape (2, starts, 1, 1)."""
    both = [(a, b) for a in limits.PAIR_STARTS for b in limits.PAIR_STARTS]
    return np.array(both).T[:, :, None, None]
