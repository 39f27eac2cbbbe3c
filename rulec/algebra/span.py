"""Which of several signed sums are independent: elimination, exact and sparse."""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from fractions import Fraction


class Span:
    """Everything that sums of the vectors added so far can make; vectors are column -> factor.

    >>> span = Span()
    >>> span.add({0: 1, 1: -1}), span.add({1: 1, 2: -1}), span.add({0: 1, 2: -1})
    (True, True, False)
    """

    def __init__(self) -> None:
        self._rows: dict[int, Mapping[int, int | Fraction]] = {}

    def holds(self, vector: Mapping[int, int]) -> bool:
        """Does a vector follow from those added?"""
        return not self._rest(vector)

    def add(self, vector: Mapping[int, int]) -> bool:
        """Add a vector; False if it was in the span already."""
        rest = self._rest(vector)
        if rest:
            pivot = max(rest)
            self._rows[pivot] = {c: _ratio(f, rest[pivot]) for c, f in rest.items()}
        return bool(rest)

    def _rest(self, vector: Mapping[int, int]) -> dict[int, int | Fraction]:
        """What is left without the rows, largest column first; its own largest has no row."""
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


def _ratio(a: int | Fraction, b: int | Fraction) -> int | Fraction:
    """Exact, and whole where the divisor is a sign: balances of flows give no other."""
    return a * b if b in (1, -1) else Fraction(a) / b
