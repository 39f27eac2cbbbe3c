"""Undo faults: how far the flows that they bias move."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset

Faults = tuple[FaultSpec, ...]
"""The simultaneous faults of one hypothesis."""

Outputs = Mapping[str, Array]


@dataclass(frozen=True)
class Part:
    """A hypothesis and its `columns`; `touched` are the usable observers that its faults bias."""

    faults: Faults
    touched: Sequence[str]
    columns: slice


@dataclass(frozen=True, kw_only=True)
class Undoing:
    """Hypotheses undone side by side: each in its own columns, at the points of each column.

    `parts` are the hypotheses. `readings` per signal have the shape
    (points, columns), SI. `measured` are the flows of the observers that the hypothesis of a column
    touches, `kept` the share of each that the baseline leaves (its correction scales with an
    estimate), both of shape (touched, points, columns), SI; 0 where a hypothesis touches fewer
    observers.
    """

    ruleset: Ruleset
    parts: Sequence[Part]
    readings: Mapping[str, Array]
    measured: Array
    kept: Array

    def moved(self, degree: Array) -> Array:
        """Movement of flows, (touched, ..., points, columns), m3/s; degrees (faults, ..., points,
        columns)."""
        moved = np.zeros((len(self.measured), *degree.shape[1:]))
        for part, out in self._undone(degree, slopes=False):
            self._enter(moved, part, out)
        return moved

    def moved_and_slopes(self, degree: Array) -> tuple[Array, Array]:
        """The same, and the slopes by each degree, shape (touched, faults, points, columns);
        degrees (faults, points, columns)."""
        moved = np.zeros_like(self.measured)
        slopes = np.zeros((len(moved), *degree.shape))
        for part, out in self._undone(degree, slopes=True):
            self._enter(moved, part, out)
            for row, observer in enumerate(part.touched):
                for place, fault in enumerate(part.faults):
                    if (slope := out.get(f"dq:{observer}:{fault.id}")) is not None:
                        slopes[row, place, :, part.columns] = slope
        return moved, slopes * self.kept[:, None]

    def _enter(self, moved: Array, part: Part, out: Outputs) -> None:
        for row, observer in enumerate(part.touched):
            own = (row, slice(None), part.columns)
            moved[row, ..., part.columns] = (out[f"q:{observer}"] - self.measured[own]) * self.kept[
                own
            ]

    def _undone(self, degree: Array, *, slopes: bool) -> Iterator[tuple[Part, Outputs]]:
        """Each hypothesis with the outputs of its plan, shape (..., points, its columns)."""
        for part in self.parts:
            faults = tuple(fault.id for fault in part.faults)
            plan = self.ruleset.undone(tuple(part.touched), faults if slopes else ())
            own = degree[..., part.columns]
            shape = own.shape[1:]
            unused = (name for name in plan.used_inputs if name.startswith("x:"))
            inputs: dict[str, Array | float] = dict.fromkeys(unused, 0.0)
            inputs |= {f"x:{f}": own[i].ravel() for i, f in enumerate(faults)}
            for name in plan.used_inputs & self.readings.keys():
                table = self.readings[name][:, part.columns]
                inputs[name] = np.broadcast_to(table, shape).ravel()
            yield part, {name: out.reshape(shape) for name, out in plan.run(inputs).items()}
