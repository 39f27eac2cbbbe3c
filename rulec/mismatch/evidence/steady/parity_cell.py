"""Points at which the same estimates check each other, and their dependence on readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.steady.system import Slopes


@dataclass(frozen=True)
class Cell:
    """Points at which the same estimates check each other.

    `observers` are numbers in the system; `basis`, shape (rank, observers), are the combinations of
    them that vanish, `outputs` as many readings that follow from the others. `whitener`, shape
    (points, rank, rank), turns errors of the outputs into rows with unit noise; `first` is the
    first of these rows.
    """

    points: NDArray[np.intp]
    observers: NDArray[np.intp]
    basis: Array
    outputs: tuple[str, ...]
    whitener: Array
    first: int

    @property
    def rank(self) -> int:
        return len(self.basis)

    @property
    def rows(self) -> slice:
        """Its rows in the table, ordered by combination."""
        return slice(self.first, self.first + len(self.points) * self.rank)

    def table(self, rows: Array) -> Array:
        """Its part of all rows, shape (rank, points)."""
        return rows[self.rows].reshape(self.rank, len(self.points))

    def at_points(self, values: Array) -> Array:
        """Values at its points, shape (points,), or one value for all."""
        return values[self.points] if values.ndim else values

    def combined(self, values: Array) -> Array:
        """Combinations of the estimates of all observers, shape (points, rank)."""
        return np.asarray((self.basis @ values[np.ix_(self.observers, self.points)]).T)

    def readings(self, by_reading: Slopes) -> tuple[str, ...]:
        """Readings on which its estimates depend."""
        reached = set(self.observers.tolist())
        return tuple(name for name, by in by_reading.items() if not reached.isdisjoint(by))

    def slopes(self, by_reading: Slopes, names: Sequence[str]) -> Array:
        """Derivatives of the combinations by readings, shape (points, rank, readings)."""
        table = np.zeros((len(self.observers), len(names), len(self.points)))
        for j, i in enumerate(self.observers.tolist()):
            for row, name in zip(table[j], names, strict=True):
                slope = by_reading.get(name, {}).get(i)
                if slope is not None:
                    row[:] = self.at_points(slope)
        combined = self.basis @ table.reshape(len(table), -1)
        combined = combined.reshape(self.rank, len(names), len(self.points))
        return np.ascontiguousarray(np.moveaxis(combined, 2, 0))


@dataclass(frozen=True)
class Linear:
    """The relations of a cell, linearised at its readings.

    `combined`, shape (points, rank), are the errors of the relations; `slopes`, shape (points,
    rank, readings), their derivatives; `scaled` those per unit of noise; `normal`, shape (points,
    rank, rank), their covariance by noise.
    """

    names: tuple[str, ...]
    combined: Array
    slopes: Array
    scaled: Array
    normal: Array

    def of_outputs(self, cell: Cell) -> Array:
        """Derivatives by the outputs, shape (points, rank, rank)."""
        return self.slopes[:, :, [self.names.index(name) for name in cell.outputs]]
