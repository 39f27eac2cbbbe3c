"""Undo faults: how far the flows that they bias move."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.diagnosis.steady import limits

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

    `parts` are the hypotheses of `every` that have columns. `readings` per signal have the shape
    (points, columns), SI. `measured` are the flows of the observers that the hypothesis of a column
    touches, `kept` the share of each that the baseline leaves (its correction scales with an
    estimate), both of shape (touched, points, columns), SI; 0 where a hypothesis touches fewer
    observers.
    """

    ruleset: Ruleset
    every: Sequence[Part]
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
        """Each hypothesis with the outputs of the plan in its columns, shape (..., points,
        columns): by one plan for all if columns are so few that a call costs more than they do."""
        if degree[0].size <= limits.FEW_COLUMNS and len(self.parts) > 1:
            # The same plan for any remaining hypotheses: laying one out takes time.
            plan = self._plan(self.every, slopes=slopes)
            if len(plan.operations) <= limits.OPERATIONS_OF_A_CALL * len(self.parts):
                out = self._run(plan, self.every, self.parts, degree)
                for part in self.parts:
                    yield part, {name: values[..., part.columns] for name, values in out.items()}
                return
        for part in self.parts:
            own = replace(part, columns=slice(None))
            readings = {name: table[:, part.columns] for name, table in self.readings.items()}
            alone = replace(self, readings=readings)
            plan = self._plan([own], slopes=slopes)
            yield part, alone._run(plan, [own], [own], degree[..., part.columns])

    def _plan(self, known: Sequence[Part], *, slopes: bool) -> Plan:
        observers = tuple(dict.fromkeys(o for part in known for o in part.touched))
        faults = tuple(dict.fromkeys(f.id for part in known for f in part.faults))
        return self.ruleset.undone(observers, faults if slopes else ())

    def _run(
        self, plan: Plan, known: Sequence[Part], tried: Sequence[Part], degree: Array
    ) -> dict[str, Array]:
        """Outputs of the plan of all known hypotheses, of which some are tried."""
        shape = degree.shape[1:]
        degrees = {f.id: np.zeros(shape) for part in known for f in part.faults}
        for part in tried:
            for fault, own in zip(part.faults, degree[..., part.columns], strict=True):
                degrees[fault.id][..., part.columns] = own
        inputs: dict[str, Array | float] = {n: 0.0 for n in plan.used_inputs if n.startswith("x:")}
        inputs |= {f"x:{name}": table.ravel() for name, table in degrees.items()}
        for name in plan.used_inputs & self.readings.keys():
            table = self.readings[name]
            inputs[name] = (
                table if table.shape == shape else np.broadcast_to(table, shape)
            ).ravel()
        return {name: values.reshape(shape) for name, values in plan.run(inputs).items()}
