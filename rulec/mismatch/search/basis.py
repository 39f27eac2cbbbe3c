"""Smooth functions of a driver, of which a term without a name is a sum."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.search import limits

KNOTS = np.linspace(0.0, 1.0, 41)
"""Shares of a driver's range at which functions are kept; between them they are straight."""


@dataclass(frozen=True)
class Basis:
    """Functions of a driver that runs from `low` to `high`, alike over the share `length` of that.

    Outside of the range, by a tenth of it, they stay as they are at its ends.
    """

    low: float
    high: float
    length: float
    says: str = ""
    price: float = 0.0

    def at(self, values: Array) -> Array:
        """Independent functions of unit prior size at values, shape (n, functions)."""
        z = np.clip((values - self.low) / max(self.high - self.low, 1e-300), -0.1, 1.1)
        table = _functions(self.length)
        return np.stack([np.interp(z, KNOTS, column) for column in table.T], axis=1)


@cache
def _functions(length: float) -> Array:
    """The functions at the knots, shape (knots, functions), those of most variance first."""
    apart = (KNOTS[:, None] - KNOTS[None, :]) ** 2
    size, ways = np.linalg.eigh(1.0 + np.exp(-0.5 * apart / length**2))
    seen = int((size > limits.FORM_RANK * size.max()).sum())
    best = np.argsort(-size)[: min(seen, limits.TERM_FUNCTIONS)]
    table: Array = ways[:, best] * np.sqrt(size[best])
    return table


def basis_over(values: Array, length: float) -> Basis:
    """The basis over all but the outermost of a driver's values, shape (n,)."""
    low, high = np.nanquantile(values, [0.02, 0.98])
    return Basis(float(low), float(high), length)
