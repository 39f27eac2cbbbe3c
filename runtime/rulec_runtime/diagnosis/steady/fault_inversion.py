"""What undoing faults does to the flows that they make wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset

Faults = tuple[FaultSpec, ...]
"""The faults of one hypothesis, at the same time."""


@dataclass(frozen=True)
class Part:
    """A hypothesis and the `columns` in which it is tried; `touched` are the usable observers that
    its faults make wrong, `readings` per signal those of the columns, shape (points, columns)."""

    faults: Faults
    touched: Sequence[str]
    columns: slice
    readings: Mapping[str, Array]

    def run(self, plan: Plan, degree: Array) -> dict[str, Array]:
        """The plan with degrees, shape (faults, ..., points, columns), in a row."""
        shape = degree.shape[1:]
        inputs: dict[str, Array | float] = {}
        for name in plan.used_inputs:
            if name in self.readings:
                inputs[name] = np.broadcast_to(self.readings[name], shape).ravel()
            elif name.startswith("x:"):
                inputs[name] = 0.0
        inputs.update({f"x:{f.id}": x.ravel() for f, x in zip(self.faults, degree, strict=True)})
        return plan.run(inputs)


@dataclass(frozen=True, kw_only=True)
class Undoing:
    """Hypotheses undone, side by side: each in columns of its own, at the points of each column.

    `measured` are the flows of the observers that the hypothesis of a column touches, `kept` the
    share of each that the baseline leaves (what it takes scales with an estimate), both of shape
    (touched, points, columns), SI; 0 where a hypothesis touches fewer observers.
    """

    ruleset: Ruleset
    parts: Sequence[Part]
    measured: Array
    kept: Array

    def moved(self, degree: Array) -> Array:
        """How far the flows move, shape (touched, ..., points, columns), m3/s; degrees
        (faults, ..., points, columns)."""
        moved = np.zeros((len(self.measured), *degree.shape[1:]))
        for part in self.parts:
            plan = self.ruleset.undone(tuple(part.touched), ())
            own = degree[..., part.columns]
            self._enter(moved, part, part.run(plan, own), own.shape[1:])
        return moved

    def moved_and_slopes(self, degree: Array) -> tuple[Array, Array]:
        """The same, and the slopes by each degree, shape (touched, faults, points, columns);
        degrees (faults, points, columns)."""
        moved = np.zeros_like(self.measured)
        slopes = np.zeros((len(moved), *degree.shape))
        for part in self.parts:
            names = tuple(f.id for f in part.faults)
            own = degree[..., part.columns]
            out = part.run(self.ruleset.undone(tuple(part.touched), names), own)
            self._enter(moved, part, out, own.shape[1:])
            for row, observer in enumerate(part.touched):
                for place, name in enumerate(names):
                    slope = out.get(f"dq:{observer}:{name}")
                    if slope is not None:
                        slopes[row, place, :, part.columns] = slope.reshape(own.shape[1:])
        return moved, slopes * self.kept[:, None]

    def _enter(
        self, moved: Array, part: Part, out: Mapping[str, Array], shape: tuple[int, ...]
    ) -> None:
        """Enter what the plan of a hypothesis gave into its columns."""
        for row, observer in enumerate(part.touched):
            measured = self.measured[row, :, part.columns]
            kept = self.kept[row, :, part.columns]
            flow = out[f"q:{observer}"].reshape(shape)
            moved[row, ..., part.columns] = (flow - measured) * kept
