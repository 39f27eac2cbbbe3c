"""Smooth functions of a driver; a term without a name is a sum of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.search import limits

KNOTS = np.linspace(0.0, 1.0, 41)
"""Shares of a driver's range at which functions are tabulated; they are linear in between."""


@dataclass(frozen=True)
class Basis:
    """Functions of a driver from `low` to `high`, constant beyond these ends.

    `length` is their correlation length as a share of that range.
    """

    low: float
    high: float
    length: float
    says: str = ""
    price: float = 0.0

    def at(self, values: Array) -> Array:
        """Independent functions of unit prior size at values, shape (n, functions)."""
        z = (values - self.low) / max(self.high - self.low, 1e-300)
        table = _functions(self.length)
        return np.stack([np.interp(z, KNOTS, column) for column in table.T], axis=1)


@cache
def _functions(length: float) -> Array:
    """The functions at the knots, shape (knots, functions), by falling variance."""
    apart = (KNOTS[:, None] - KNOTS[None, :]) ** 2
    size, ways = np.linalg.eigh(1.0 + np.exp(-0.5 * apart / length**2))
    rank = int((size > limits.FORM_RANK * size.max()).sum())
    best = np.argsort(-size)[: min(rank, limits.TERM_FUNCTIONS)]
    return np.asarray(ways[:, best] * np.sqrt(size[best]))


def basis_over(values: Array, length: float) -> Basis:
    """The basis over the range of a driver without its outermost values, shape (n,)."""
    low, high = np.nanquantile(values, [0.02, 0.98])
    return Basis(float(low), float(high), length)
