"""Linear equations among flows, solved once and for all (Gauss)."""

from __future__ import annotations

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.limits import ZERO_PIVOT


def independent_without(matrix: Array, first: int) -> Array:
    """Independent sums of rows that have no entries in the first columns.

    >>> independent_without(np.array([[1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [2.0, 1.0, 1.0]]), 1)
    array([[ 0. , -0.5,  0.5]])
    """
    rest = matrix.copy()
    done = kept = 0
    for j in range(matrix.shape[1]):
        if done == len(rest):
            break
        pivot = done + int(np.argmax(np.abs(rest[done:, j])))
        if abs(rest[pivot, j]) < ZERO_PIVOT:
            continue
        rest[[done, pivot]] = rest[[pivot, done]]
        # Balances have few flows, so most rows stay unchanged.
        rows = done + 1 + np.flatnonzero(rest[done + 1 :, j])
        rest[rows] -= np.outer(rest[rows, j] / rest[done, j], rest[done])
        done += 1
        kept += j < first
    return rest[kept:done]


def solved_for(matrix: Array, first: int) -> tuple[Array, Array]:
    """Solve equations (rows, each a sum equal to zero) for the unknowns of the first columns.

    Returns
    -------
    Each of these unknowns as a sum of the other columns, and the equations that remain of them.

    >>> solved_for(np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]]), 1)
    (array([[1., 0.]]), array([[-1.,  1.]]))
    """
    rest = matrix.copy()
    pivots: list[int] = []
    for j in range(first):
        free = np.abs(rest[:, j])
        free[pivots] = 0.0
        pivot = int(np.argmax(free))
        rest[pivot] /= rest[pivot, j]
        rows = np.flatnonzero(rest[:, j])
        rows = rows[rows != pivot]
        rest[rows] -= np.outer(rest[rows, j], rest[pivot])
        pivots.append(pivot)
    rest[np.abs(rest) < ZERO_PIVOT] = 0.0
    return 0.0 - rest[pivots, first:], np.delete(rest, pivots, axis=0)[:, first:]
