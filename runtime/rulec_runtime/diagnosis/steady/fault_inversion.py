"""What undoing faults does to the flows that they make wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset

Faults = tuple[FaultSpec, ...]
"""The faults of one hypothesis, at the same time."""


@dataclass(frozen=True)
class Part:
    """A hypothesis and the `columns` in which it is tried; `touched` are the usable observers that
    its faults make wrong."""

    faults: Faults
    touched: Sequence[str]
    columns: slice


@dataclass(frozen=True, kw_only=True)
class Undoing:
    """Hypotheses undone, side by side: each in columns of its own, at the points of each column.

    `readings` per signal have the shape (points, columns), SI. `measured` are the flows of the
    observers that the hypothesis of a column touches, `kept` the share of each that the baseline
    leaves (what it takes scales with an estimate), both of shape (touched, points, columns), SI; 0
    where a hypothesis touches fewer observers.
    """

    ruleset: Ruleset
    parts: Sequence[Part]
    readings: Mapping[str, Array]
    measured: Array
    kept: Array

    def moved(self, degree: Array) -> Array:
        """How far the flows move, shape (touched, ..., points, columns), m3/s; degrees
        (faults, ..., points, columns)."""
        moved = np.zeros((len(self.measured), *degree.shape[1:]))
        for part in self.parts:
            self._enter(moved, part, self._undone(part, degree, slopes=False))
        return moved

    def moved_and_slopes(self, degree: Array) -> tuple[Array, Array]:
        """The same, and the slopes by each degree, shape (touched, faults, points, columns);
        degrees (faults, points, columns)."""
        moved = np.zeros_like(self.measured)
        slopes = np.zeros((len(moved), *degree.shape))
        for part in self.parts:
            out = self._undone(part, degree, slopes=True)
            self._enter(moved, part, out)
            for row, observer in enumerate(part.touched):
                for place, fault in enumerate(part.faults):
                    if (slope := out.get(f"dq:{observer}:{fault.id}")) is not None:
                        slopes[row, place, :, part.columns] = slope
        return moved, slopes * self.kept[:, None]

    def _enter(self, moved: Array, part: Part, out: Mapping[str, Array]) -> None:
        """Enter what the plan of a hypothesis gave into its columns."""
        for row, observer in enumerate(part.touched):
            own = (row, slice(None), part.columns)
            moved[row, ..., part.columns] = (out[f"q:{observer}"] - self.measured[own]) * self.kept[
                own
            ]

    def _undone(self, part: Part, degree: Array, *, slopes: bool) -> dict[str, Array]:
        """Outputs of the plan of a hypothesis in its columns, shape (..., points, columns)."""
        names = tuple(fault.id for fault in part.faults)
        plan = self.ruleset.undone(tuple(part.touched), names if slopes else ())
        own = degree[..., part.columns]
        shape = own.shape[1:]
        inputs: dict[str, Array | float] = {n: 0.0 for n in plan.used_inputs if n.startswith("x:")}
        inputs |= {f"x:{name}": one.ravel() for name, one in zip(names, own, strict=True)}
        for name in plan.used_inputs & self.readings.keys():
            table = self.readings[name][:, part.columns]
            inputs[name] = np.broadcast_to(table, shape).ravel()
        return {name: values.reshape(shape) for name, values in plan.run(inputs).items()}
