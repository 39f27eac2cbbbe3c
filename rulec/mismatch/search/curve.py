"""A curve over one reading at a place: what has no name, as a term that can be drawn and read.

Source: generalised additive models (Hastie, Tibshirani 1986).
"""

from __future__ import annotations

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, Spot
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.search import limits


def curve_at(
    fitted: Fitted, spot: Spot, name: str, most: int = limits.BANDS[0]
) -> Candidate | None:
    """A piecewise linear curve of so many pieces at most over a reading; None where its readings
    are too near each other."""
    parts = pieces_over(fitted, name, most)
    # All of them together are a constant, which base values may hold.
    pieces = [i for i in range(parts + 1) if i != parts // 2]
    features = tuple(f"{name}~{i}/{parts}" for i in pieces)
    return fitted.rows.system.builder.free_form(spot.id, features) if parts else None


def _knots(fitted: Fitted, name: str, parts: int) -> Array:
    data = fitted.rows.system.data
    knots: Array = np.nanquantile(data.values[name][data.open], np.linspace(0.0, 1.0, parts + 1))
    return knots


def pieces_over(fitted: Fitted, name: str, most: int = limits.BANDS[0]) -> int:
    """Pieces of a curve over a reading, so many at most; 0 where its readings are too near each
    other.

    Bands within the noise of a reading, as at a few operating points, would sort that noise.
    """
    data = fitted.rows.system.data
    least = limits.BAND_WIDTH * float(np.nanmedian(data.noise[name][data.open]))
    few = [n for n in limits.BANDS if n <= most]
    apart = (n for n in few if float(np.min(np.diff(_knots(fitted, name, n)))) >= least)
    return next(apart, 0)
