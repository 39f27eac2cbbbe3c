"""Operating points as systems of equations, for Newton's method (runtime/newton.py)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from runtime.equations import Equations
from runtime.newton import Index
from runtime.plan import Array

STEP = 6e-6
"""Share of a reading by which derivatives are taken: about the cube root of the rounding error."""

SMALL = 1e-4
"""Share of its scale below which a reading's derivative is taken with a fixed step."""


@dataclass(frozen=True)
class OperatingPoints:
    """n operating points on the way from the reference point (share 0) to where they are asked.

    Unknowns are predicted readings, then flows, both in units of their scales. Arrays of `given`
    (SI) and `degrees` have shape (n,), `offsets` (observers, n), m3/s.
    """

    equations: Equations
    given: Mapping[str, Array]
    degrees: Mapping[str, Array]
    offsets: Array

    def residuals(self, at: Array, share: Array, index: Index) -> Array:
        """Estimates less flows, and what is missing in the balances; in units of the flows."""
        equations = self.equations
        readings, flows = np.split(at, [len(equations.predicted)], axis=1)
        estimates = self._estimates(readings, share, index) + share * self.offsets[:, index]
        module = equations.module_of
        disagreement = estimates.T / equations.flow_scales[module] - flows[:, module]
        return np.concatenate([disagreement, flows @ equations.scaled_balances.T], axis=1)

    def jacobian(self, at: Array, share: Array, index: Index) -> Array:
        """Derivatives: by readings from central differences, by flows exact."""
        equations = self.equations
        k, readings, rows = len(at), len(equations.predicted), len(equations.module_of)
        result = np.zeros((k, rows + len(equations.balances), at.shape[1]))
        result[:, np.arange(rows), readings + equations.module_of] = -1.0
        result[:, rows:, readings:] = equations.scaled_balances
        observer, reading = equations.dependencies
        slopes = self._slopes(at[:, :readings], share, index)
        size = equations.flow_scales[equations.module_of[observer]]
        result[:, observer, reading] = (slopes / size[:, None]).T
        return result

    def _slopes(self, readings: Array, share: Array, index: Index) -> Array:
        """Derivative of the estimate in each dependency, shape (dependencies, k), m3/s.

        One run of the plan serves all groups of readings and both sides.
        """
        equations = self.equations
        groups, k = equations.groups, len(readings)
        step = STEP * np.maximum(np.abs(readings), SMALL)
        moved = np.tile(readings, (len(groups), 2, 1, 1))
        for g, members in enumerate(groups):
            moved[g, 0][:, members] += step[:, members]
            moved[g, 1][:, members] -= step[:, members]
        copies = 2 * len(groups)
        estimates = self._estimates(
            moved.reshape(copies * k, readings.shape[1]),
            np.tile(share, copies),
            np.tile(index, copies),
        )
        sides = estimates.reshape(len(estimates), len(groups), 2, k)
        change = sides[:, :, 0] - sides[:, :, 1]
        observer, reading = equations.dependencies
        slopes: Array = change[observer, equations.group_of[reading]] / (2.0 * step.T[reading])
        return slopes

    def _estimates(self, readings: Array, share: Array, index: Index) -> Array:
        """Flows by all observers, faults undone, shape (observers, k), m3/s."""
        equations = self.equations
        inputs: dict[str, Array | float] = dict.fromkeys(equations.plan.inputs, 0.0)
        inputs.update(zip(equations.predicted, (readings * equations.scales).T, strict=True))
        for signal in equations.given_signals:
            change = self.given[signal.id][index] - signal.reference
            inputs[signal.id] = signal.reference + share * change
        for name, degree in self.degrees.items():
            inputs[f"x:{name}"] = share * degree[index]
        out = equations.plan.run(inputs)
        shape = (len(readings),)
        observers = equations.ruleset.observers
        return np.array([np.broadcast_to(out[f"q:{o.id}"], shape) for o in observers])
