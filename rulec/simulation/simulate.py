"""Readings of a plant with given faults, from its ruleset alone.

The ruleset's `undo` plan gives every estimate of a flow with faults undone. At the readings of a
plant all estimates of a module agree on one flow, and the flows balance at the junctions, so the
equations that diagnose also simulate. They are solved step by step, in the order that the compiler
found. `prediction.py` adds the errors of sensors.

Source: own derivation; Newton's method with continuation (`newton.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.nearest import did_you_mean

from rulec.algebra.tangent import run_with_slopes
from rulec.simulation.equations import DEGREE, Equations, SimulationRefused, StepEquations
from rulec.simulation.newton import Index, follow

Given = Mapping[str, Array | float]


@dataclass(frozen=True)
class Simulated:
    """n operating points.

    Attributes
    ----------
    values : an array per signal that some observer reads, shape (n,), SI, without sensor errors;
        given ones as given, NaN where one is not predicted.
    flows : an array per module with observers, shape (n,), m3/s; NaN where it is not found.
    solved : shape (n,); whether everything was found.
    failed : shape (n,); number of the first step without solution, -1 where none failed. A step
        that lacks an input is not found, but has not failed.
    """

    values: Mapping[str, Array]
    flows: Mapping[str, Array]
    solved: NDArray[np.bool_]
    failed: NDArray[np.intp]
    _course: _Course

    def why(self, sample: int) -> str:
        """Why an operating point has no solution; empty if it has one."""
        return self._course.why(sample) if self.failed[sample] >= 0 else ""


def simulate_with(
    equations: Equations, given: Given, degrees: Given, offsets: Given | None = None
) -> Simulated:
    """Find the readings of a plant.

    Raises `SimulationRefused` if the plant has no such name, or if a number is not allowed.

    Parameters
    ----------
    given : an array, shape (n,), or a number, per input and per reading that no observer
        determines; SI. Absent ones stay at the reference point. A given reading is what its sensor
        shows, even if a fault makes it wrong. Where it is NaN, what depends on it is not found.
    degrees : degree per fault id, shape (n,) or a number. Several faults may act at once.
    offsets : error of the law per observer id, m3/s.
    """
    offsets = offsets or {}
    _check(equations, given, degrees, offsets)
    ends = {
        **{s.id: given.get(s.id, s.reference) for s in equations.given_signals},
        **{f"{DEGREE}{name}": degree for name, degree in degrees.items()},
        **{f"{OFFSET}{name}": offset for name, offset in offsets.items()},
    }
    (n,) = np.broadcast_shapes((1,), *(np.shape(v) for v in ends.values()))
    values = {k: np.broadcast_to(np.asarray(v, dtype=float), (n,)) for k, v in ends.items()}
    course = _Course(equations, values, np.full(n, -1), np.ones(n), np.full((n, 2), -1.0))
    for number, step in enumerate(equations.steps):
        course.take(number, step)
    found = [values[name] for name in (*equations.predicted, *equations.flows)]
    return Simulated(
        {s.id: values[s.id] for s in equations.ruleset.signals if s.id in values},
        {m: values[m] for m in equations.flows},
        np.isfinite(found).all(axis=0) & np.ones(n, dtype=bool),
        course.failed,
        course,
    )


OFFSET = "offset:"
"""Prefix of the error of an observer's law among what is known."""


@dataclass(frozen=True)
class _Course:
    """The steps taken so far.

    `values` are readings, SI, flows, degrees and offsets. `failed` and `reached`, shape (n,), are
    the number of the first step without solution, and the share of the way on which it has one.
    `worst`, shape (n, 2), is its smallest flow: number, and share of its scale.
    """

    equations: Equations
    values: dict[str, Array]
    failed: NDArray[np.intp]
    reached: Array
    worst: Array

    def take(self, number: int, step: StepEquations) -> None:
        """Find the readings and flows of a step wherever its inputs are known.

        Flows that are not positive are no operating point.
        """
        n = len(self.failed)
        needed = [self.values[name] for name in (*step.known_readings, *step.known_flows)]
        index = np.flatnonzero(np.isfinite(needed).all(axis=0) & np.ones(n, dtype=bool))
        points = OperatingPoints(step, self.values, self.equations.reference)
        self.values.update({name: np.full(n, np.nan) for name in (*step.readings, *step.flows)})
        if not index.size:
            return
        at, reached = np.tile(step.start, (len(index), 1)), np.ones(len(index))
        if step.readings:
            at, reached = follow(points, at, index)
        flows = points.flows(at, np.maximum(reached, 0.0), index)
        found = (reached == 1.0) & (flows > 0).all(axis=1)
        for j, name in enumerate(step.readings):
            self.values[name][index[found]] = at[found, j] * step.scales[j]
        for j, name in enumerate(step.flows):
            self.values[name][index[found]] = flows[found, j] * step.flow_scales[j]
        first = ~found & (self.failed[index] < 0)
        lost = index[first]
        self.failed[lost], self.reached[lost] = number, reached[first]
        if step.flows and lost.size:
            self.worst[lost] = np.c_[flows[first].argmin(axis=1), flows[first].min(axis=1)]

    def why(self, sample: int) -> str:
        """Why the failed step has no solution."""
        step, reached = self.equations.steps[self.failed[sample]], float(self.reached[sample])
        acting = {n: d for n, d in self.values.items() if n.startswith(DEGREE)}
        what = [f"{n.removeprefix(DEGREE)} {degree[sample]:g}" for n, degree in acting.items()]
        for signal in self.equations.given_signals:
            shown = signal.shown(self.values[signal.id][sample])
            what.append(f"{signal.id} {shown:.4g} {signal.unit}")
        text = f"no operating point at {', '.join(what)}: "
        if reached < 0:
            return text + "not even the reference point solves these equations"
        ending = f"nothing satisfies {', '.join(step.observers)}"
        if step.flows:
            number, part = self.worst[sample]
            flow = step.flows[int(number)]
            ending = f"{flow} carries {100.0 * part:.2g} % of its reference flow"
        if reached == 1.0:
            return text + ending
        way = f"the way there from the reference point ends at {100.0 * reached:.4g} %"
        return f"{text}{way}, where {ending}"


def _check(equations: Equations, given: Given, degrees: Given, offsets: Given) -> None:
    """Refuse names that the plant does not have, and numbers out of range."""
    ruleset = equations.ruleset
    kinds = (
        ("input", given, equations.given),
        ("fault", degrees, ruleset.fault_by_id),
        ("observer", offsets, ruleset.observer_by_id),
    )
    for kind, table, ids in kinds:
        for name, value in table.items():
            if name not in ids:
                hint = did_you_mean(name, ids)
                raise SimulationRefused(f"{ruleset.plant} has no {kind} '{name}'; {hint}")
            if np.any(np.isinf(value)) or (kind != "input" and np.any(np.isnan(value))):
                raise SimulationRefused(f"{name}: not every value is a number")
    for name, value in degrees.items():
        fault = ruleset.fault_by_id[name]
        if np.any(np.asarray(value) < fault.lowest) or np.any(np.asarray(value) > fault.highest):
            raise SimulationRefused(
                f"{name}: give a degree from {fault.lowest:g} to {fault.highest:g}"
                f"{f' {fault.unit}' if fault.unit else ', where 0.2 is 20 %'}"
            )


@dataclass(frozen=True)
class OperatingPoints:
    """One step of n operating points, from the reference point (share 0) to the requested ones.

    The unknowns are the readings of the step in units of their scales. `ends` holds what is known,
    shape (n,); `starts` the same at share 0, where degrees and offsets are 0.
    """

    step: StepEquations
    ends: Mapping[str, Array]
    starts: Mapping[str, float]

    def linearised(self, at: Array, share: Array, index: Index) -> tuple[Array, Array]:
        """Residuals, shape (k, m), and their derivatives, shape (k, m, m)."""
        step, k = self.step, len(at)
        values, slopes = run_with_slopes(step.plan, self._inputs(at, share, index), step.readings)
        left = _summed(step.zeros, self._terms(values, share, index)).T
        column = {name: j for j, name in enumerate(step.readings)}
        jacobian = np.zeros((len(step.readings), len(step.readings), k))
        for row, observer, factor in step.terms:
            for name, slope in slopes[f"q:{step.observers[observer]}"].items():
                j = column[name]
                jacobian[row, j] += factor * step.scales[j] * slope
        return left, np.moveaxis(jacobian, -1, 0)

    def flows(self, at: Array, share: Array, index: Index) -> Array:
        """Flows at given readings, in units of their scales, shape (k, flows)."""
        step = self.step
        values = step.plan.run(self._inputs(at, share, index))
        return _summed(step.sums, self._terms(values, share, index)).T / step.flow_scales

    def _inputs(self, at: Array, share: Array, index: Index) -> dict[str, Array]:
        own = dict(zip(self.step.readings, at.T * self.step.scales[:, None], strict=True))
        others = (name for name in self.step.plan.inputs if name not in own)
        return {**{name: self._on_the_way(name, share, index) for name in others}, **own}

    def _on_the_way(self, name: str, share: Array, index: Index) -> Array:
        start, end = self.starts.get(name, 0.0), self.ends.get(name)
        return np.asarray(start if end is None else start + share * (end[index] - start))

    def _terms(self, values: Mapping[str, Array], share: Array, index: Index) -> Array:
        """Estimates, then known flows, shape (observers + known flows, k), m3/s."""
        rows = [
            values[f"q:{name}"] + self._on_the_way(f"{OFFSET}{name}", share, index)
            for name in self.step.observers
        ]
        rows += [self._on_the_way(name, share, index) for name in self.step.known_flows]
        rows = [np.broadcast_to(row, index.shape) for row in rows]
        return np.array(rows).reshape(len(rows), len(index))


def _summed(factors: Array, terms: Array) -> Array:
    """Matrix product, term by term: unlike in BLAS, a column does not depend on the others."""
    result = np.zeros((len(factors), terms.shape[1]))
    for row, column in zip(*np.nonzero(factors), strict=True):
        result[row] += factors[row, column] * terms[column]
    return result
