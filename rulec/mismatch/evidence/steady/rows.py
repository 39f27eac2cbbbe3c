"""Residuals as rows of one table, in units of their noise.

Flows are eliminated: estimates of the same flows beyond one per free flow are redundant, and their
combinations vanish in a healthy plant (`redundancy.py`). As many readings, the *outputs*, follow
from the others. A residual is the error of its output, measured less predicted, so that rescaling a
relation changes nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.redundancy import blocks_of, patterns_of, residual_basis

from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.steady.system import Flows, Slopes, System

# Solve many small systems of equations at once, one per point, with one unknown per output.


def inverses(matrices: Array) -> Array:
    """Invert k matrices, shape (k, r, r); NaN where one is singular.

    Rows and columns are scaled before a system counts as singular, as unknowns differ in units. Of
    matrices scaled so, the determinant bounds the condition (Guggenheimer, Edelman, Johnson 1995).
    """
    if matrices.shape[1] == 1:
        return 1.0 / np.where(np.isfinite(matrices) & (matrices != 0.0), matrices, np.nan)
    sound = np.isfinite(matrices).all(axis=(1, 2), keepdims=True)
    finite = np.where(sound, matrices, 0.0)
    rows = np.abs(finite).max(axis=2, keepdims=True)
    scaled = finite / np.where(rows > 0.0, rows, 1.0)
    columns = np.abs(scaled).max(axis=1, keepdims=True)
    scaled /= np.where(columns > 0.0, columns, 1.0)
    sound &= np.abs(np.linalg.det(scaled))[:, None, None] > limits.SINGULAR
    inverse = np.linalg.inv(np.where(sound, scaled, np.eye(matrices.shape[1])))
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = inverse / np.swapaxes(columns, 1, 2) / np.swapaxes(rows, 1, 2)
    return np.where(sound, inverse, np.nan)


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
        table, obeying, data = np.full(len(self), np.nan), dict[str, Array](), self.system.data
        for cell in self.cells:
            names = cell.readings(flows.by_reading)
            combined, slopes = cell.combined(flows.values), cell.slopes(flows.by_reading, names)
            outputs = [names.index(name) for name in cell.outputs]
            off = _product(inverses(slopes[:, :, outputs]), combined)
            whitened = _product(cell.whitener, off)
            table[cell.rows] = whitened.T.ravel()
            noise = np.stack([data.noise[name][cell.points] for name in names], axis=1)
            scaled = slopes * noise[:, None, :]
            size = np.abs(scaled.reshape(len(scaled), -1)).max(axis=1, initial=0.0)
            size = np.where(size < limits.NO_SLOPE, size, 0.0)[:, None, None]
            normal = scaled @ np.swapaxes(scaled, 1, 2) + (1e-6 * size) ** 2 * np.eye(cell.rank)
            weight = _product(inverses(normal), combined)
            shifts, alone = np.einsum("nrm,nr->nm", scaled, weight) * noise, np.zeros_like(noise)
            alone[:, outputs] = off
            large = np.einsum("nr,nr->n", whitened, whitened) > limits.RECONCILED**2 * cell.rank
            shifts = np.nan_to_num(np.where(large[:, None], alone, shifts))
            for name, shift in zip(names, shifts.T, strict=True):
                measured = data.values[name][cell.points]
                # A reading keeps its sign.
                sign, most = np.sign(measured), np.abs(measured)
                low, high = -limits.MOST_AWAY_FROM_ZERO * most, limits.MOST_TOWARDS_ZERO * most
                step = sign * np.minimum(np.maximum(sign * shift, low), high)
                obeying.setdefault(name, data.values[name].copy())[cell.points] -= step
        return table, obeying

    def maps(self, flows: Flows) -> Maps:
        """Maps from changes of estimates to rows, at the readings of `flows`."""
        result = []
        for cell in self.cells:
            inverse = inverses(cell.slopes(flows.by_reading, cell.outputs))
            map_ = np.nan_to_num((cell.whitener @ inverse) @ cell.basis)
            result.append(np.ascontiguousarray(map_.transpose(2, 1, 0)))
        return tuple(result)

    def column(self, maps: Maps, slopes: Mapping[int, Array]) -> Array:
        """Rows of a change of some observers, each of shape (n,) or one value for all points."""
        table = np.zeros(len(self))
        for i, change in slopes.items():
            for number, j in self._cells_of.get(i, ()):
                cell = self.cells[number]
                values = cell.at_points(change)
                if not np.isfinite(values).all():
                    values = np.nan_to_num(values, posinf=0.0, neginf=0.0)
                part = cell.table(table)
                part += maps[number][j] * values
        return table

    @cached_property
    def _cells_of(self) -> Mapping[int, tuple[tuple[int, int], ...]]:
        """Cells of each observer, by number, with its index in each."""
        found: dict[int, tuple[tuple[int, int], ...]] = {}
        for number, cell in enumerate(self.cells):
            for j, i in enumerate(cell.observers.tolist()):
                found[i] = (*found.get(i, ()), (number, j))
        return found

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
    numbers = [np.tile(cell.points, cell.rank) for cell in cells]
    return Rows(system, tuple(cells), np.concatenate([*numbers, np.zeros(0, dtype=int)]))


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
    if not sound.any():
        return None
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
