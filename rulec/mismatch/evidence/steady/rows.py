"""Residuals as rows of one table, in units of their noise.

Flows are eliminated: estimates of the same flows beyond one per free flow are redundant, and their
combinations vanish in a healthy plant (`redundancy.py`). As many readings, the *outputs*, follow
from the others. A residual is the error of its output, measured less predicted, so that rescaling a
relation changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.redundancy import blocks_of, patterns_of, residual_basis

from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.parity_cell import Cell, Linear
from rulec.mismatch.evidence.steady.small_systems import inverses, inverses_of
from rulec.mismatch.evidence.steady.system import Flows, System

Maps = tuple[Array, ...]
"""Map of each cell from changes of estimates to whitened errors, (observers, rank, points)."""


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

        Errors are exact where estimates are linear in the outputs, as they mostly are. Where errors
        are noise, the readings are reconciled: they move to the nearest ones, in units of their
        noise, that obey the relations. Slopes at noisy readings would be correlated with the
        errors, and bias parameters. Where errors are larger, only the outputs move: an effect is
        missing, which does not concern the other readings.

        Source: Gauss-Helmert model (Mikhail and Ackermann 1976, chapter 9).
        """
        table = np.full(len(self), np.nan)
        obeying: dict[str, Array] = {}
        linear = [self._linear(cell, flows) for cell in self.cells]
        of_outputs = [part.of_outputs(cell) for part, cell in zip(linear, self.cells, strict=True)]
        inverse = inverses_of([*of_outputs, *(part.normal for part in linear)])
        for number, (cell, part) in enumerate(zip(self.cells, linear, strict=True)):
            off = _product(inverse[number], part.combined)
            whitened = _product(cell.whitener, off)
            table[cell.rows] = whitened.T.ravel()
            weight = _product(inverse[len(self.cells) + number], part.combined)
            shifts = np.einsum("nrm,nr->nm", part.scaled, weight)
            shifts *= self._noise(cell, part.names)
            large = np.einsum("nr,nr->n", whitened, whitened) > limits.RECONCILED**2 * cell.rank
            alone = np.zeros_like(shifts)
            alone[:, [part.names.index(name) for name in cell.outputs]] = off
            self._move(obeying, cell, part.names, np.where(large[:, None], alone, shifts))
        return table, obeying

    def _move(
        self, obeying: dict[str, Array], cell: Cell, names: Sequence[str], shifts: Array
    ) -> None:
        """Subtract shifts, shape (points, readings), from readings, but keep the signs of these."""
        values = self.system.data.values
        measured = np.stack([values[name][cell.points] for name in names], axis=1)
        sign, size = np.sign(measured), np.abs(measured)
        towards_zero = sign * np.nan_to_num(shifts)
        kept = sign * np.minimum(
            np.maximum(towards_zero, -limits.MOST_AWAY_FROM_ZERO * size),
            limits.MOST_TOWARDS_ZERO * size,
        )
        for name, shift in zip(names, kept.T, strict=True):
            if name not in obeying:
                obeying[name] = values[name].copy()
            obeying[name][cell.points] -= shift

    def _linear(self, cell: Cell, flows: Flows) -> Linear:
        """The relations of a cell at the readings of `flows`."""
        names = cell.readings(flows.by_reading)
        slopes = cell.slopes(flows.by_reading, names)
        scaled = slopes * self._noise(cell, names)[:, None, :]
        size = np.abs(scaled.reshape(len(scaled), -1)).max(axis=1, initial=0.0)
        size = np.where(size < limits.NO_SLOPE, size, 0.0)[:, None, None]
        normal = scaled @ np.swapaxes(scaled, 1, 2) + (1e-6 * size) ** 2 * np.eye(cell.rank)
        return Linear(names, cell.combined(flows.values), slopes, scaled, normal)

    def _noise(self, cell: Cell, names: Sequence[str]) -> Array:
        noise = self.system.data.noise
        return np.stack([noise[name][cell.points] for name in names], axis=1)

    def maps(self, flows: Flows) -> Maps:
        """Maps from changes of estimates to rows, at the readings of `flows`."""
        slopes = [cell.slopes(flows.by_reading, cell.outputs) for cell in self.cells]
        result = []
        for cell, inverse in zip(self.cells, inverses_of(slopes), strict=True):
            map_ = np.nan_to_num((cell.whitener @ inverse) @ cell.basis)
            result.append(np.ascontiguousarray(map_.transpose(2, 1, 0)))
        return tuple(result)

    def column(self, maps: Maps, slopes: Mapping[int, Array]) -> Array:
        """Rows of a change of some observers, each of shape (n,) or one value for all points."""
        table = np.zeros(len(self))
        for i, change in slopes.items():
            for number, j in self._places.get(i, ()):
                cell = self.cells[number]
                values = cell.at_points(change)
                if not np.isfinite(values).all():
                    values = np.nan_to_num(values, posinf=0.0, neginf=0.0)
                part = cell.table(table)
                part += maps[number][j] * values
        return table

    @cached_property
    def _places(self) -> Mapping[int, tuple[tuple[int, int], ...]]:
        """Cells of each observer, by number, with its index in each."""
        places: dict[int, tuple[tuple[int, int], ...]] = {}
        for number, cell in enumerate(self.cells):
            for j, i in enumerate(cell.observers.tolist()):
                places[i] = (*places.get(i, ()), (number, j))
        return places

    @cached_property
    def group(self) -> NDArray[np.intp]:
        """Number of the (cell, point) of each row, shape (rows,): these rows count together."""
        groups, start = [np.zeros(0, dtype=int)], 0
        for cell in self.cells:
            groups.append(start + np.tile(np.arange(len(cell.points)), cell.rank))
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
        """Rows of each group, shape (groups,)."""
        return np.bincount(self.group, minlength=self.groups)

    def per_group(self, rows: Array) -> Array:
        """Sum over the rows of each group, shape (groups,)."""
        return np.bincount(self.group, rows, minlength=self.groups).astype(float)


def rows_of(system: System, setting: Configuration) -> Rows:
    """Find the estimates that check each other, and the noise of the outputs at a setting."""
    flows = system.flows(setting)
    cells: list[Cell] = []
    start = 0
    for members in _blocks(system):
        for flags, points in patterns_of(system.valid[members]):
            observers = members[flags]
            if len(points) < max(limits.RARE_PATTERN * len(system.data), 2) or len(observers) < 2:
                continue
            basis = _basis(system, observers)
            cell = _cell(system, flows, observers, basis, points, start) if len(basis) else None
            if cell is not None:
                cells.append(cell)
                start += len(cell.points) * cell.rank
    places = [np.tile(cell.points, cell.rank) for cell in cells]
    return Rows(system, tuple(cells), np.concatenate([*places, np.zeros(0, dtype=int)]))


def _cell(
    system: System,
    flows: Flows,
    observers: NDArray[np.intp],
    basis: Array,
    points: NDArray[np.intp],
    first: int,
) -> Cell | None:
    """Choose outputs and whiten their errors; None where no reading follows from others."""
    points = points[np.isfinite(flows.values[np.ix_(observers, points)]).all(axis=0)]
    bare = Cell(points, observers, basis, (), np.zeros(0), first)
    names = bare.readings(flows.by_reading)
    table = bare.slopes(flows.by_reading, names)
    by_noise = {
        name: table[:, :, j] * system.data.noise[name][points][:, None]
        for j, name in enumerate(names)
    }
    by_noise = {name: part for name, part in by_noise.items() if np.isfinite(part).all()}
    outputs = _outputs(system, by_noise, len(basis))
    if outputs is None or not len(points):
        return None
    slopes = bare.slopes(flows.by_reading, outputs)
    every = np.stack(list(by_noise.values()), axis=2)
    noise = inverses(slopes) @ every
    covariance = noise @ np.swapaxes(noise, 1, 2)
    size = np.stack([np.abs(system.data.values[name][points]) for name in outputs], axis=1)
    diagonal = np.arange(len(basis))
    covariance[:, diagonal, diagonal] += (limits.LEAST_NOISE * (size + size.mean(axis=0))) ** 2
    sound = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    whitener = np.linalg.inv(np.linalg.cholesky(covariance[sound]))
    return Cell(points[sound], observers, basis, outputs, whitener, first)


def _product(matrices: Array, vectors: Array) -> Array:
    """One matrix times one vector per point, shapes (n, r, r) and (n, r)."""
    return np.asarray(np.einsum("nrs,ns->nr", matrices, vectors))


def _outputs(system: System, by_noise: Mapping[str, Array], rank: int) -> tuple[str, ...] | None:
    """As many readings as combinations: in turn that whose noise shows most beside the others."""
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


def _blocks(system: System) -> list[NDArray[np.intp]]:
    """Numbers of the observers that may check each other."""
    ruleset, number = system.ruleset, system.number
    blocks = []
    for block in blocks_of(ruleset):
        ids = [o.id for o, inside in zip(ruleset.observers, block, strict=True) if inside]
        members = [number[name] for name in ids if name in number]
        if len(members) > 1:
            blocks.append(np.array(members))
    return blocks


def _basis(system: System, observers: Sequence[int] | NDArray[np.intp]) -> Array:
    ruleset = system.ruleset
    valid = np.zeros(len(ruleset.observers), dtype=bool)
    valid[[ruleset.observer_index[system.observers[i].id] for i in observers]] = True
    return residual_basis(ruleset, valid)  # columns in the order of the ruleset, as here
