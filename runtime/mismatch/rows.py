"""Residuals as rows of one table, in units of their noise.

Flows are eliminated: what several estimates of the same flows say beyond one value per free flow
is redundant, and vanishes in a healthy plant that obeys its relations (runtime/redundancy.py).
So many readings, the *outputs*, follow from the others. A residual is told as the error of its
output, measured less predicted: whoever only rescales a relation gains nothing by it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from runtime.mismatch.setting import Setting
from runtime.mismatch.system import Flows, Slopes, System
from runtime.plan import Array
from runtime.redundancy import blocks_of, patterns_of, residual_basis

RARE = 0.01
"""Patterns of usable estimates at fewer points than this share are left out."""

TINY = 1e-6
"""Share of an output's size below which noise counts as this much: nothing is exact."""

SINGULAR = 1e10
"""Condition from which on a system of outputs has no solution."""

HUGE = 1e100
"""A slope beyond this is none."""

NOISY = 3.0
"""Errors beyond this many standard uncertainties are no mere noise."""

SMALLEST, LARGEST = 0.95, 20.0
"""Share of a reading by which it may be moved towards zero, and away from it."""

Maps = tuple[Array, ...]
"""Per cell the map from changes of estimates to whitened errors, (points, rank, observers)."""


@dataclass(frozen=True)
class Cell:
    """Points at which the same estimates check each other.

    `observers` are numbers in the system, `basis` shape (rank, observers) their combinations that
    vanish, `outputs` as many readings that follow from the others. `whitener`, shape (points,
    rank, rank), turns errors of the outputs into rows with unit noise; `first` is its first row.
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
        """Its rows in the table; those of one point follow each other."""
        return slice(self.first, self.first + len(self.points) * self.rank)

    def combined(self, of_observer: Mapping[int, Array], n: int) -> Array:
        """Combinations of observers' values that vanish, shape (points, rank)."""
        result = np.zeros((len(self.points), self.rank))
        for j, i in enumerate(self.observers):
            if int(i) in of_observer:
                values = np.broadcast_to(of_observer[int(i)], (n,))[self.points]
                result += values[:, None] * self.basis[:, j]
        return result

    def slopes(self, by_reading: Slopes, n: int) -> Array:
        """Derivatives of the combinations by the outputs, shape (points, rank, rank)."""
        columns = [self.combined(by_reading.get(name, {}), n) for name in self.outputs]
        return np.stack(columns, axis=2)


@dataclass(frozen=True)
class Rows:
    """All residuals of a recording; `point` gives the point of each row, shape (rows,)."""

    system: System
    cells: tuple[Cell, ...]
    point: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.point)

    def errors(self, flows: Flows) -> tuple[Array, dict[str, Array]]:
        """Whitened errors of the outputs, shape (rows,), and readings that obey the relations, SI.

        Errors are exact where estimates are linear in the outputs, as they mostly are. Where they
        are no more than noise, the readings are reconciled: the nearest, in units of their noise,
        that obey. Slopes taken at noisy readings would be correlated with the errors, and
        parameters biased. Where errors are larger, the outputs alone are moved: something is left
        out, and the other readings have no part in it.

        Source: Gauss-Helmert model (Mikhail and Ackermann 1976, chapter 9).
        """
        n = len(self.system.data)
        table = np.full(len(self), np.nan)
        values = dict(enumerate(flows.values))
        obeying: dict[str, Array] = {}
        for cell in self.cells:
            combined = cell.combined(values, n)
            off = _solved(cell.slopes(flows.by_reading, n), combined[:, :, None])
            whitened = (cell.whitener @ off)[:, :, 0]
            table[cell.rows] = whitened.ravel()
            large = np.sqrt(np.mean(whitened**2, axis=1)) > NOISY
            for name, shift in self._shifts(cell, flows, combined).items():
                alone = off[:, cell.outputs.index(name), 0] if name in cell.outputs else 0.0
                self._move(obeying, name, cell.points, np.where(large, alone, shift))
        return table, obeying

    def _move(
        self, obeying: dict[str, Array], name: str, points: NDArray[np.intp], shift: Array
    ) -> None:
        """Take a shift off a reading, its sign kept."""
        measured = self.system.data.values[name]
        course = obeying.setdefault(name, measured.copy())
        size = np.abs(measured[points])
        towards_zero = np.sign(measured[points]) * np.nan_to_num(shift)
        kept = np.clip(towards_zero, -LARGEST * size, SMALLEST * size)
        course[points] -= np.sign(measured[points]) * kept

    def _shifts(self, cell: Cell, flows: Flows, combined: Array) -> dict[str, Array]:
        """What each reading of a cell is off the nearest ones that obey, shape (points,)."""
        n = len(self.system.data)
        reached = {int(i) for i in cell.observers}
        names = [name for name, by in flows.by_reading.items() if reached & set(by)]
        slopes = np.stack([cell.combined(flows.by_reading[x], n) for x in names], axis=2)
        noise = np.stack([self.system.data.noise[x][cell.points] for x in names], axis=1)
        scaled = slopes * noise[:, None, :]
        size = np.abs(scaled).max(axis=(1, 2), initial=0.0)[:, None, None]
        size = np.where(size < HUGE, size, 0.0)
        diagonal = (1e-6 * size) ** 2 * np.eye(cell.rank)
        weight = _solved(scaled @ np.swapaxes(scaled, 1, 2) + diagonal, combined[:, :, None])
        shift = (np.swapaxes(scaled, 1, 2) @ weight)[:, :, 0] * noise
        return {name: shift[:, j] for j, name in enumerate(names)}

    def maps(self, flows: Flows) -> Maps:
        """How changes of the estimates show in the rows, at the readings of `flows`."""
        n = len(self.system.data)
        result = []
        for cell in self.cells:
            slopes = cell.slopes(flows.by_reading, n)
            wide = np.broadcast_to(cell.basis, (len(slopes), *cell.basis.shape))
            result.append(np.nan_to_num(cell.whitener @ _solved(slopes, wide)))
        return tuple(result)

    def column(self, maps: Maps, slopes: Mapping[int, Array]) -> Array:
        """Rows of a change of some observers, each shape (n,)."""
        table = np.zeros(len(self))
        n = len(self.system.data)
        for cell, map_ in zip(self.cells, maps, strict=True):
            part = np.zeros((len(cell.points), cell.rank))
            for j, i in enumerate(cell.observers):
                if int(i) in slopes:
                    values = np.broadcast_to(slopes[int(i)], (n,))[cell.points]
                    part += map_[:, :, j] * np.nan_to_num(values)[:, None]
            table[cell.rows] = part.ravel()
        return table

    @cached_property
    def group(self) -> NDArray[np.intp]:
        """Number of the (cell, point) of each row: rows that are judged together."""
        groups, start = [np.zeros(0, dtype=int)], 0
        for cell in self.cells:
            groups.append(start + np.repeat(np.arange(len(cell.points)), cell.rank))
            start += len(cell.points)
        return np.concatenate(groups)

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
    """Find what checks what, and the noise of the outputs' errors at a setting."""
    flows = system.flows(setting)
    cells: list[Cell] = []
    start = 0
    for members in _blocks(system):
        for flags, points in patterns_of(system.valid[members]):
            observers = members[flags]
            if len(points) < max(RARE * len(system.data), 2) or len(observers) < 2:
                continue
            basis = _basis(system, observers)
            cell = _cell(system, flows, observers, basis, points, start) if len(basis) else None
            if cell is not None:
                cells.append(cell)
                start += len(cell.points) * cell.rank
    places = [np.repeat(cell.points, cell.rank) for cell in cells]
    return Rows(system, tuple(cells), np.concatenate([*places, np.zeros(0, dtype=int)]))


def _cell(
    system: System,
    flows: Flows,
    observers: NDArray[np.intp],
    basis: Array,
    points: NDArray[np.intp],
    first: int,
) -> Cell | None:
    """Choose outputs, and whiten their errors; None where no reading follows from others."""
    points = points[np.isfinite(flows.values[np.ix_(observers, points)]).all(axis=0)]
    bare = Cell(points, observers, basis, (), np.zeros(0), first)
    n = len(system.data)
    by_noise = {
        name: bare.combined(slopes, n) * system.data.noise[name][points][:, None]
        for name, slopes in flows.by_reading.items()
        if any(int(i) in slopes for i in observers)
    }
    by_noise = {name: part for name, part in by_noise.items() if np.isfinite(part).all()}
    outputs = _outputs(system, by_noise, len(basis))
    if outputs is None or not len(points):
        return None
    slopes = Cell(points, observers, basis, outputs, np.zeros(0), first).slopes(flows.by_reading, n)
    every = np.stack(list(by_noise.values()), axis=2)
    noise = _solved(slopes, every)
    covariance = noise @ np.swapaxes(noise, 1, 2)
    size = np.stack([np.abs(system.data.values[name][points]) for name in outputs], axis=1)
    diagonal = np.arange(len(basis))
    covariance[:, diagonal, diagonal] += (TINY * (size + size.mean(axis=0))) ** 2
    sound = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    factor = np.linalg.cholesky(covariance[sound])
    whitener = np.linalg.inv(factor)
    return Cell(points[sound], observers, basis, outputs, whitener, first)


def _outputs(system: System, by_noise: Mapping[str, Array], rank: int) -> tuple[str, ...] | None:
    """As many readings as there are combinations: those whose noise shows most in new ways."""
    signals = system.ruleset.signal_by_id
    names = [name for name in by_noise if not signals[name].is_input]
    if len(names) < rank:
        return None
    table = np.stack([np.median(by_noise[name], axis=0) for name in names], axis=1)
    table = table / max(float(np.abs(table).max()), 1e-300)
    chosen: list[str] = []
    for _ in range(rank):
        sizes = np.round(np.linalg.norm(table, axis=0), 12)
        best = int(np.argmax(sizes))
        if sizes[best] <= 0.0:
            return None
        chosen.append(names[best])
        direction = table[:, best] / np.linalg.norm(table[:, best])
        table = table - np.outer(direction, direction @ table)
        table[:, best] = 0.0
    return tuple(chosen)


def _solved(matrices: Array, right: Array) -> Array:
    """Solve k small systems; NaN where one has no solution.

    Outputs have units of their own: rows and columns are brought to one size before a system
    counts as singular.
    """
    sound = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    one = np.eye(matrices.shape[1])
    safe = np.where(sound[:, None, None], matrices, one)
    rows = _size(safe, 2)
    columns = _size(safe / rows, 1)
    scaled = safe / rows / columns
    sound &= np.linalg.cond(scaled) < SINGULAR
    scaled = np.where(sound[:, None, None], scaled, one)
    solution = np.linalg.solve(scaled, right / rows) / np.swapaxes(columns, 1, 2)
    result: Array = np.where(sound[:, None, None], solution, np.nan)
    return result


def _size(matrices: Array, axis: int) -> Array:
    """Largest entry along an axis, 1 where there is none."""
    sizes = np.abs(matrices).max(axis=axis, initial=0.0, keepdims=True)
    return np.where(sizes > 0, sizes, 1.0)


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


def _basis(system: System, observers: Sequence[int] | NDArray[np.intp]) -> Array:
    ruleset = system.ruleset
    valid = np.zeros(len(ruleset.observers), dtype=bool)
    valid[[ruleset.observer_index[system.observers[i].id] for i in observers]] = True
    return residual_basis(ruleset, valid)  # columns in the order of the ruleset, as here
