"""Residuals as rows of one table, in units of their noise.

Flows are eliminated: what several estimates of the same flows say beyond one value per free flow
is redundant, and vanishes in a healthy plant that obeys its relations (runtime/redundancy.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from runtime.mismatch.setting import Setting
from runtime.mismatch.system import Flows, System
from runtime.plan import Array
from runtime.redundancy import blocks_of, patterns_of, residual_basis
from runtime.ruleset import Ruleset

RARE = 0.01
"""Patterns of usable estimates at fewer points than this share are left out."""

TINY = 1e-6
"""Share of a flow's size below which noise counts as this much: nothing is exact."""


@dataclass(frozen=True)
class Cell:
    """Points at which the same estimates check each other.

    `observers` are numbers in the system; `weights` has shape (points, rows, observers): noise-
    whitened combinations of the estimates that vanish. `first` is the place of its first row.
    """

    points: NDArray[np.intp]
    observers: NDArray[np.intp]
    weights: Array
    first: int

    @property
    def rank(self) -> int:
        return int(self.weights.shape[1])

    @property
    def rows(self) -> slice:
        """Its rows in the table; those of one point follow each other."""
        return slice(self.first, self.first + len(self.points) * self.rank)


@dataclass(frozen=True)
class Rows:
    """All residuals of a recording; `point` gives the point of each row, shape (rows,)."""

    system: System
    cells: tuple[Cell, ...]
    point: NDArray[np.intp]
    rank: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.point)

    def residual(self, flows: Array) -> Array:
        """Whitened residuals of flows, shape (observers, n) to (rows,)."""
        return self._table(dict(enumerate(flows)))

    def column(self, slopes: Mapping[int, Array]) -> Array:
        """The same linear map on the slopes of some observers."""
        return self._table(slopes)

    def _table(self, of_observer: Mapping[int, Array]) -> Array:
        table = np.zeros(len(self))
        n = len(self.system.data)
        for cell in self.cells:
            held = [(j, i) for j, i in enumerate(cell.observers) if int(i) in of_observer]
            if not held:
                continue
            part = np.zeros((len(cell.points), cell.rank))
            for j, i in held:
                values = np.broadcast_to(of_observer[int(i)], (n,))[cell.points]
                part += cell.weights[:, :, j] * values[:, None]
            table[cell.rows] = part.ravel()
        return table

    @cached_property
    def group(self) -> NDArray[np.intp]:
        """Number of the (cell, point) of each row: rows that are judged together."""
        pairs, start = [], 0
        for cell in self.cells:
            pairs.append(start + np.repeat(np.arange(len(cell.points)), cell.rank))
            start += len(cell.points)
        return np.concatenate(pairs) if pairs else np.zeros(0, dtype=int)

    @cached_property
    def groups(self) -> int:
        return int(self.group[-1]) + 1 if len(self.group) else 0

    @cached_property
    def group_point(self) -> NDArray[np.intp]:
        """Point of each group, shape (groups,)."""
        points: NDArray[np.intp] = np.zeros(self.groups, dtype=int)
        points[self.group] = self.point
        return points

    @cached_property
    def group_rank(self) -> NDArray[np.intp]:
        """Rows of each group."""
        return np.bincount(self.group, minlength=self.groups)

    def per_group(self, rows: Array) -> Array:
        """Sum over the rows of each group, shape (groups,)."""
        sums: Array = np.bincount(self.group, rows, minlength=self.groups).astype(float)
        return sums


def rows_of(system: System, setting: Setting) -> Rows:
    """Find what checks what, and whiten by the noise of the readings at a setting."""
    flows = system.flows(setting)
    cells: list[Cell] = []
    start = 0
    for members in _blocks(system):
        for flags, points in patterns_of(system.valid[members]):
            observers = members[flags]
            if len(points) < max(RARE * len(system.data), 2) or len(observers) < 2:
                continue
            basis = _basis(system, observers)
            if not len(basis):
                continue
            finite = np.isfinite(flows.values[np.ix_(observers, points)]).all(axis=0)
            points = points[finite]
            if not len(points):
                continue
            weights = _whitened(basis, _noise(system, flows, observers, points))
            cells.append(Cell(points, observers, weights, start))
            start += len(points) * len(basis)
    return Rows(system, tuple(cells), *_places(cells))


def _places(cells: Iterable[Cell]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    points = [np.repeat(cell.points, cell.rank) for cell in cells]
    ranks = [np.full(len(cell.points) * cell.rank, cell.rank) for cell in cells]
    none = [np.zeros(0, dtype=int)]
    return np.concatenate(points or none), np.concatenate(ranks or none)


def _blocks(system: System) -> list[NDArray[np.intp]]:
    """Numbers of the observers that check each other."""
    ruleset, number = system.ruleset, system.number
    blocks = []
    for block in blocks_of(ruleset):
        ids = [o.id for o, inside in zip(ruleset.observers, block.observers, strict=True) if inside]
        members = [number[name] for name in ids if name in number]
        if len(members) > 1:
            blocks.append(np.array(members))
    return blocks


def _basis(system: System, observers: NDArray[np.intp]) -> Array:
    ruleset: Ruleset = system.ruleset
    valid = np.zeros(len(ruleset.observers), dtype=bool)
    valid[[ruleset.observer_index[system.observers[i].id] for i in observers]] = True
    return residual_basis(ruleset, valid)  # columns in the order of the ruleset, as here


def _noise(
    system: System, flows: Flows, observers: NDArray[np.intp], points: NDArray[np.intp]
) -> Array:
    """Covariance of the estimates by the noise of the readings, shape (points, o, o)."""
    n = len(system.data)
    size = len(observers)
    covariance = np.zeros((len(points), size, size))
    for name, slopes in flows.by_reading.items():
        u = system.data.noise[name][points]
        held = [(a, int(i)) for a, i in enumerate(observers) if int(i) in slopes]
        columns = {a: np.broadcast_to(slopes[i], (n,))[points] * u for a, i in held}
        for a, left in columns.items():
            for b, right in columns.items():
                covariance[:, a, b] += left * right
    level = np.abs(flows.values[np.ix_(observers, points)]).mean(axis=0)
    covariance[:, np.arange(size), np.arange(size)] += (TINY * level[:, None]) ** 2
    return covariance


def _whitened(basis: Array, covariance: Array) -> Array:
    """Combinations with unit covariance, shape (points, rank, observers)."""
    factor = np.linalg.cholesky(basis @ covariance @ basis.T)
    result: Array = np.linalg.solve(factor, np.broadcast_to(basis, (len(factor), *basis.shape)))
    return result
