"""The few combinations of many estimates that show some faults.

A fault moves few flows, and all that hundreds of estimates say about these are a few combinations:
the rows of the second derivative of chi-square by the flows. At one operating point the degree of
the fault affects chi-square in no other way. So only these combinations are stacked, and the stack
does not grow with the size of the plant.

Source: own derivation; a sufficient statistic of Gaussian errors (Fisher 1922).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.chi_square import inverse_of
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest
from rulec_runtime.diagnosis.steady.redundancy import covariance_of


@dataclass(frozen=True)
class Contrasts:
    """Combinations that show the faults detectable at one point, if so many points are stacked.

    Their mean is subject to noise and to many times the lasting errors; their differences to noise
    only.
    """

    test: HypothesisTest
    stacked: int

    @cached_property
    def _weights(self) -> tuple[Array, Array]:
        """Half the second derivative of chi-square by flows, (flows, flows): of differences, of the
        mean."""
        test, (point,) = self.test, self.test.members
        noise, whole = (
            covariance_of(test.basis, one, test.valid, np.arange(1))
            for one in (test.observed.noise[point], test.observed.covariance_at(point))
        )
        both = noise, noise + self.stacked * (whole - noise)
        of_differences, of_mean = (test.basis.T @ inverse_of(one)[0] @ test.basis for one in both)
        return of_differences, of_mean

    def rows(self, fault: int) -> dict[tuple[int, int], Array]:
        """Combinations of the flows that show a fault, shape (flows,) each; for one that moves many
        flows, the most informative ones, and the sum of all."""
        rows, slopes = self.test.each[fault]
        slope, found = slopes[:, 0, 0], {}
        for k, weight in enumerate(self._weights):
            most = np.arange(len(rows))
            if len(rows) > limits.ROWS_OF_A_FAULT:
                together = slope @ weight[rows]
                share = np.abs(slope * together[rows])
                most = np.argsort(-share, kind="stable")[: limits.ROWS_OF_A_FAULT - 1]
                found[k, -1 - fault] = together
            found |= {(k, rows[i]): weight[rows[i]] for i in most.tolist()}
        return found

    def basis(self, faults: Iterable[int]) -> tuple[Array, list[int]]:
        """Independent combinations that show faults, orthonormal, shape (rank, flows), and the
        faults they show: the first ones, as long as combinations are few."""
        rows: dict[tuple[int, int], Array] = {}
        shown: list[int] = []
        for fault in faults:
            if fault not in self.test.each:
                continue
            more = self.rows(fault)
            if shown and len(rows.keys() | more.keys()) > limits.ROWS_TOGETHER:
                break
            rows |= more
            shown.append(fault)
        unit = [row / size for row in rows.values() if (size := np.linalg.norm(row)) > 0.0]
        if not unit:
            return np.zeros((0, self.test.basis.shape[1])), shown
        _, sizes, basis = np.linalg.svd(np.array(unit), full_matrices=False)
        return np.asarray(basis[sizes > limits.SAME_ROWS * sizes[0]]), shown

    def groups(self) -> Iterator[tuple[Array, list[int]]]:
        """All faults in groups of neighbours, with the combinations that show each group."""
        left = list(self.test.each)
        while left:
            basis, shown = self.basis(left)
            if not shown:
                return
            left = left[left.index(shown[-1]) + 1 :]
            yield basis, shown
