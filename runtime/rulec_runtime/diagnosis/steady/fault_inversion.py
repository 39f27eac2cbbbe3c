"""Undo faults: how far the flows that they bias move."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset

Faults = tuple[FaultSpec, ...]
"""The simultaneous faults of one hypothesis."""


@dataclass(frozen=True, kw_only=True)
class Undoing:
    """Faults undone at points of n problems.

    `touched` are the usable observers that they bias. `readings` per signal have the shape (points,
    n), SI. `measured` are the flows of the touched observers, `kept` the share of each that the
    baseline leaves (its correction scales with an estimate), both of shape (touched, points, n),
    SI.
    """

    ruleset: Ruleset
    faults: Faults
    touched: Sequence[str]
    readings: Mapping[str, Array]
    measured: Array
    kept: Array

    def moved(self, degree: Array) -> Array:
        """Movement of flows, (touched, ..., points, n), m3/s; degrees (faults, ..., points, n)."""
        return self._moved(self._undone(degree, ()))

    def moved_and_slopes(self, degree: Array) -> tuple[Array, Array]:
        """The same, and the slopes by each degree, shape (touched, faults, points, n); degrees
        (faults, points, n)."""
        names = tuple(fault.id for fault in self.faults)
        out = self._undone(degree, names)
        none = np.zeros(degree.shape[1:])
        slopes = [[out.get(f"dq:{o}:{name}", none) for name in names] for o in self.touched]
        return self._moved(out), np.array(slopes) * self.kept[:, None]

    def _moved(self, out: Mapping[str, Array]) -> Array:
        flows = (out[f"q:{o}"] for o in self.touched)
        each = zip(flows, self.measured, self.kept, strict=True)
        return np.array([(flow - measured) * kept for flow, measured, kept in each])

    def _undone(self, degree: Array, slopes: tuple[str, ...]) -> dict[str, Array]:
        """Outputs of the plan, (..., points, n) each, with `slopes` by the degrees of faults."""
        plan, shape = self.ruleset.undone(tuple(self.touched), slopes), degree.shape[1:]
        unused = (name for name in plan.used_inputs if name.startswith("x:"))
        inputs: dict[str, Array | float] = dict.fromkeys(unused, 0.0)
        own = zip(self.faults, degree, strict=True)
        inputs |= {f"x:{fault.id}": each.ravel() for fault, each in own}
        for name in plan.used_inputs & self.readings.keys():
            inputs[name] = np.broadcast_to(self.readings[name], shape).ravel()
        return {name: out.reshape(shape) for name, out in plan.run(inputs).items()}
