"""Sums and means of the samples of stretches."""

from __future__ import annotations

import numpy as np

from rulec_runtime.contract.plan import Array


def sums_between(values: Array, first: np.ndarray, last: np.ndarray) -> Array:
    """Sums of the samples ``first : last``, of stretches in order of time, shape (n,)."""
    if not len(first):
        return np.zeros(0)
    edges = np.column_stack([first, last]).ravel()
    # What ends with the samples needs no edge.
    inside = edges[:-1] if edges[-1] == len(values) else edges
    sums: Array = np.add.reduceat(values, np.minimum(inside, len(values) - 1))[::2]
    return np.where(last > first, sums, 0.0)


def means_between(values: Array, first: np.ndarray, last: np.ndarray) -> tuple[Array, Array]:
    """Means of the samples ``first : last`` that have a reading, and how many these are."""
    number = (last - first).astype(float)
    known = np.isfinite(values)
    if not known.all():
        number = sums_between(known.astype(float), first, last)
        values = np.where(known, values, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return sums_between(values, first, last) / number, number
