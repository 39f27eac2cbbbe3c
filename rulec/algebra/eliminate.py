"""Linear relations among flows: elimination (Gauss), and which signed sums are independent."""

import heapq
from collections.abc import Mapping
from fractions import Fraction

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.limits import ZERO_PIVOT


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


class Span:
    """The linear span of the vectors added so far; a vector maps columns to factors.

    >>> span = Span()
    >>> span.add({0: 1, 1: -1}), span.add({1: 1, 2: -1}), span.add({0: 1, 2: -1})
    (True, True, False)
    """

    def __init__(self) -> None:
        self._rows: dict[int, Mapping[int, int | Fraction]] = {}

    def holds(self, vector: Mapping[int, int]) -> bool:
        """Whether the vector is in the span."""
        return not self._rest(vector)

    def add(self, vector: Mapping[int, int]) -> bool:
        """Add a vector; False if it was in the span already."""
        rest = self._rest(vector)
        if rest:
            pivot = max(rest)
            # Balances of flows have no pivots other than +1 and -1: their factors stay integers.
            own = rest[pivot]
            inverse = own if own in (1, -1) else 1 / Fraction(own)
            self._rows[pivot] = {column: factor * inverse for column, factor in rest.items()}
        return bool(rest)

    def _rest(self, vector: Mapping[int, int]) -> dict[int, int | Fraction]:
        """The vector reduced by the rows, until its largest column has no row."""
        rest: dict[int, int | Fraction] = dict(vector)
        waiting = [-column for column in rest]
        heapq.heapify(waiting)
        while waiting:
            pivot = -heapq.heappop(waiting)
            factor = rest.get(pivot, 0)
            if not factor:
                continue
            row = self._rows.get(pivot)
            if row is None:
                break
            for column, value in row.items():
                if column not in rest:
                    heapq.heappush(waiting, -column)
                rest[column] = rest.get(column, 0) - factor * value
        return {column: factor for column, factor in rest.items() if factor}
