"""Operating points as systems of equations, for Newton's method (`newton.py`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.algebra.tangent import run_with_slopes
from rulec.simulation.equations import DEGREE, StepEquations
from rulec.simulation.newton import Index


@dataclass(frozen=True)
class OperatingPoints:
    """One step of n operating points, from the reference point (share 0) to the requested ones.

    The unknowns are the readings of the step in units of their scales. `known` (readings, SI, and
    flows, m3/s), `degrees` and `offsets` per observer (m3/s) hold arrays of shape (n,).
    `reference` holds the known values at share 0.
    """

    step: StepEquations
    known: Mapping[str, Array]
    reference: Mapping[str, float]
    degrees: Mapping[str, Array]
    offsets: Mapping[str, Array]

    def linearised(self, at: Array, share: Array, index: Index) -> tuple[Array, Array]:
        """Residuals, shape (k, m), and their derivatives, shape (k, m, m)."""
        step, k = self.step, len(at)
        values, slopes = run_with_slopes(step.plan, self._inputs(at, share, index), step.readings)
        left = _summed(step.zeros, self._terms(values, share, index)).T
        column = {name: j for j, name in enumerate(step.readings)}
        jacobian = np.zeros((len(step.readings), len(step.readings), k))
        for row, place, factor in step.terms:
            for name, slope in slopes[f"q:{step.observers[place]}"].items():
                j = column[name]
                jacobian[row, j] += factor * step.scales[j] * slope
        return left, np.moveaxis(jacobian, -1, 0)

    def flows(self, at: Array, share: Array, index: Index) -> Array:
        """Flows at given readings, in units of their scales, shape (k, flows)."""
        step = self.step
        values = step.plan.run(self._inputs(at, share, index))
        return _summed(step.sums, self._terms(values, share, index)).T / step.flow_scales

    def _inputs(self, at: Array, share: Array, index: Index) -> dict[str, Array | float]:
        step = self.step
        inputs: dict[str, Array | float] = {f"{DEGREE}{name}": 0.0 for name in step.faults}
        for name in step.known_readings:
            inputs[name] = self._on_the_way(name, share, index)
        for name in step.faults:
            if name in self.degrees:
                inputs[f"{DEGREE}{name}"] = share * self.degrees[name][index]
        inputs.update(zip(step.readings, at.T * step.scales[:, None], strict=True))
        return inputs

    def _on_the_way(self, name: str, share: Array, index: Index) -> Array:
        start = self.reference[name]
        between: Array = start + share * (self.known[name][index] - start)
        return between

    def _terms(self, values: Mapping[str, Array], share: Array, index: Index) -> Array:
        """Estimates, then known flows, shape (observers + known flows, k), m3/s."""
        step, k = self.step, len(index)
        rows = []
        for name in step.observers:
            estimate = np.broadcast_to(values[f"q:{name}"], (k,))
            if name in self.offsets:
                estimate = estimate + share * self.offsets[name][index]
            rows.append(estimate)
        rows += [self._on_the_way(name, share, index) for name in step.known_flows]
        return np.array(rows).reshape(len(rows), k)


def _summed(factors: Array, terms: Array) -> Array:
    """Matrix product, term by term: unlike in BLAS, a column does not depend on the others."""
    result = np.zeros((len(factors), terms.shape[1]))
    for row, place in zip(*np.nonzero(factors), strict=True):
        result[row] += factors[row, place] * terms[place]
    return result
