"""The few combinations of many estimates that tell of some faults.

What a fault moves are a few flows, and all that hundreds of estimates say of these at one point are
as many combinations: the rows of the second derivative of chi-square by the flows. No degree of the
fault has an effect on chi-square otherwise. So stretches are stacked by these alone, and neither
memory nor time grows with the size of the plant.

Source: own derivation, docs/method.md; a sufficient statistic of Gaussian errors.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest


@dataclass(frozen=True)
class Contrasts:
    """What tells of the faults that one point can show; the test has that point alone."""

    test: HypothesisTest

    @cached_property
    def _weight(self) -> Array:
        """Half the second derivative of chi-square by the flows, shape (flows, flows)."""
        weight: Array = self.test.metric.weighing.of_flows[1][0]
        return weight

    @property
    def faults(self) -> Iterator[int]:
        """Faults that the point can show, in order."""
        return iter(self.test.each)

    def rows(self, fault: int) -> Array:
        """Combinations of the flows that tell of a fault, shape (rows, flows): of one that moves
        many flows, those that tell most, and all of them together."""
        places, slopes = self.test.each[fault]
        own = self._weight[places]
        if len(places) <= limits.ROWS_OF_A_FAULT:
            return own
        slope = slopes[:, 0, 0]
        together = slope @ own
        share = np.abs(slope * together[places])
        most = np.sort(np.argsort(-share, kind="stable")[: limits.ROWS_OF_A_FAULT - 1])
        return np.vstack([own[most], together])

    def basis(self, faults: Iterable[int]) -> tuple[Array, list[int]]:
        """Independent combinations that tell of faults, orthonormal, shape (rank, flows), and the
        faults that they tell of: the first ones, as long as combinations are few."""
        tables: list[Array] = []
        told: list[int] = []
        for fault in faults:
            rows = self.rows(fault) if fault in self.test.each else np.zeros((0, 0))
            if not rows.any():
                continue
            if tables and sum(map(len, tables)) + len(rows) > limits.ROWS_TOGETHER:
                break
            tables.append(rows)
            told.append(fault)
        return _orthonormal(tables, self._weight), told

    def groups(self) -> Iterator[tuple[Array, list[int]]]:
        """All faults, neighbours together, with what tells of each group."""
        left = list(self.faults)
        while left:
            basis, told = self.basis(left)
            if not told:
                return
            left = left[left.index(told[-1]) + 1 :]
            yield basis, told


def _orthonormal(tables: Sequence[Array], like: Array) -> Array:
    """Orthonormal basis of what some rows span."""
    if not tables:
        return np.zeros((0, len(like)))
    rows = np.unique(np.vstack(tables), axis=0)
    _, sizes, basis = np.linalg.svd(rows / np.linalg.norm(rows, axis=1)[:, None], full_matrices=False)
    independent: Array = basis[sizes > limits.SAME_ROWS * sizes[0]]
    return independent
