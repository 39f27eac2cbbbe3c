"""What undoing faults does to the flows that they make wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset

Faults = tuple[FaultSpec, ...]
"""The faults of one hypothesis, at the same time."""


@dataclass(frozen=True, kw_only=True)
class Undoing:
    """Faults undone in the observers they touch, at n points.

    `readings` per signal and `measured` per touched observer, shapes (n,) and (touched, n), SI.
    `kept` is the share of each flow that the baseline leaves, shape (touched, n): what it takes
    scales with an estimate.
    """

    ruleset: Ruleset
    faults: Faults
    touched: Sequence[str]
    readings: Mapping[str, Array]
    measured: Array
    kept: Array

    def moved(self, degree: Array) -> Array:
        """How far the flows move, shape (touched, ..., n), m3/s; degrees (faults, ..., n)."""
        plan = self.ruleset.undone(tuple(self.touched), ())
        return self._moved(self._run(plan, degree), degree)

    def moved_and_slopes(self, degree: Array) -> tuple[Array, Array]:
        """The same, and the slopes by each degree, shape (touched, faults, n); degrees
        (faults, n)."""
        out = self._run(self._with_slopes, degree)
        none = np.zeros(degree.shape[1])
        slopes = [[out.get(f"dq:{o}:{f.id}", none) for f in self.faults] for o in self.touched]
        return self._moved(out, degree), np.array(slopes) * self.kept[:, None]

    @cached_property
    def _with_slopes(self) -> Plan:
        return self.ruleset.undone(tuple(self.touched), tuple(f.id for f in self.faults))

    def _moved(self, out: Mapping[str, Array], degree: Array) -> Array:
        flows = np.array([out[f"q:{o}"].reshape(degree.shape[1:]) for o in self.touched])
        wide = (len(flows), *[1] * (degree.ndim - 2), -1)
        moved: Array = (flows - self.measured.reshape(wide)) * self.kept.reshape(wide)
        return moved

    def _run(self, plan: Plan, degree: Array) -> dict[str, Array]:
        inputs: dict[str, Array | float] = {}
        for name in plan.used_inputs:
            if name in self.readings:
                inputs[name] = _repeated(self.readings[name], degree)
            elif name.startswith("x:"):
                inputs[name] = 0.0
        inputs.update({f"x:{f.id}": x.ravel() for f, x in zip(self.faults, degree, strict=True)})
        return plan.run(inputs)


def _repeated(values: Array, degree: Array) -> Array:
    """Readings once for each degree that is tried."""
    times = degree[0].size // values.size if values.size else 1
    return values if times == 1 else np.tile(values, times)
