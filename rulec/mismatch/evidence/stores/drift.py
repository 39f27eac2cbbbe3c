"""Effects of sensor errors within their class, which no model has to explain.

Each reading may be off by its stated uncertainty. An error of a flow meter fills a tank with no
other outflow without limit; such an error may also change slowly. Its effect on predicted readings
is removed from their errors as far as its size allows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.stationary import systematic_u

from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem


@dataclass(frozen=True)
class Drift:
    """Sensor errors within their class, each in units of its standard uncertainty.

    `moved` are their effects on readings, shape (signals * samples, errors), with the measured
    signals stacked. `shapes` has the input and the course of each error, SI, shape (n,); None for
    the zero error of a predicted reading.
    """

    moved: Array
    shapes: tuple[tuple[str, Array] | None, ...]

    @property
    def count(self) -> int:
        """Number of errors."""
        return len(self.shapes)

    def put_right(self, inputs: Mapping[str, Array], errors: Array) -> dict[str, Array]:
        """Inputs, shape (n,), SI, corrected for errors, shape (errors,)."""
        result = dict(inputs)
        for shape, size in zip(self.shapes, errors, strict=True):
            if shape is not None and size:
                result[shape[0]] = result[shape[0]] + size * shape[1]
        return result

    def given(self, errors: Array) -> Array:
        """Errors of inputs, with all others 0, shape (errors,)."""
        return np.where([shape is not None for shape in self.shapes], errors, 0.0)


def no_drift(bench: SimulationProblem) -> Drift:
    """No sensor errors."""
    return Drift(np.zeros((len(bench.signals) * len(bench.time), 0)), ())


def drift_of(
    bench: SimulationProblem, joined: tuple[str, ...], values: Mapping[str, float]
) -> Drift:
    """All notable sensor errors, linearised at a model."""
    record = bench.record
    columns: list[Array] = []
    shapes: list[tuple[str, Array] | None] = []
    plain = bench.simulate(joined, values).stacked
    spread = np.repeat([np.nanstd(v) for v in record.measured.values()], len(bench.time))
    for name, course in record.inputs.items():
        if name not in bench.balances(joined).inputs:
            continue
        u = systematic_u(bench.ruleset.signal_by_id[name], course)
        u = np.broadcast_to(u, course.shape)
        changed = {**record.inputs, name: course + u}
        moved = bench.simulate(joined, values, inputs=changed).stacked
        size = float(np.max(np.abs(moved - plain) / np.maximum(spread, 1e-300)))
        if size < limits.NOTABLE_DRIFT:
            continue
        large = size > limits.LARGE_DRIFT
        ways = hats(bench.time, limits.DRIFT_KNOTS) if large else [np.ones(len(bench.time))]
        for shape in ways:
            changed = {**record.inputs, name: course + u * shape}
            columns.append(bench.simulate(joined, values, inputs=changed).stacked - plain)
            shapes.append((name, u * shape))
    zeros = _zero_errors(bench)
    return Drift(np.column_stack([*columns, *zeros]), (*shapes, *([None] * len(zeros))))


def _zero_errors(bench: SimulationProblem) -> list[Array]:
    """The zero error of each predicted reading, shape (signals * samples,), SI."""
    measured, found = bench.record.measured, []
    for i, (name, course) in enumerate(measured.items()):
        own = np.zeros((len(measured), len(course)))
        own[i] = np.nan_to_num(systematic_u(bench.ruleset.signal_by_id[name], course))
        found.append(own.ravel())
    return found


def moved_again(
    drift: Drift,
    bench: SimulationProblem,
    joined: tuple[str, ...],
    values: Mapping[str, float],
    inputs: Mapping[str, Array],
) -> Drift:
    """The same errors, linearised at another model, where other volumes may run over a rim.
    `inputs` have shape (n,), SI."""
    plain = bench.simulate(joined, values, inputs=inputs).stacked
    columns = list(drift.moved.T)
    for i, shape in enumerate(drift.shapes):
        if shape is not None:
            changed = {**inputs, shape[0]: inputs[shape[0]] + shape[1]}
            columns[i] = bench.simulate(joined, values, inputs=changed).stacked - plain
    return replace(drift, moved=np.column_stack(columns)) if columns else drift


def hats(over: Array, knots: int) -> list[Array]:
    """Piecewise linear shapes, shape (n,), over the range of a course, which add up to one."""
    ends = np.linspace(over.min(), over.max(), knots)
    return [np.interp(over, ends, row) for row in np.eye(knots)]


def errors_of_sensors(
    bench: SimulationProblem, ids: tuple[str, ...], values: Mapping[str, float]
) -> Array:
    """Effects of constant sensor errors within their class on readings, stacked, shape (signals *
    samples, errors), SI. Errors that move belong to the wandering error of a model."""
    inputs = bench.record.inputs
    plain = bench.simulate(ids, values).stacked
    found = []
    for name in (n for n in inputs if n in bench.balances(ids).inputs):
        u = systematic_u(bench.ruleset.signal_by_id[name], inputs[name])
        changed = {**inputs, name: inputs[name] + u}
        found.append(bench.simulate(ids, values, inputs=changed).stacked - plain)
    return np.stack([*found, *_zero_errors(bench)], axis=1)
