"""What errors of sensors within their class do: no model is to blame for those.

Each reading may be off by its stated uncertainty. A flow meter that is off by a share of its class
fills a tank that nothing empties by itself without end; there the error may change slowly too. What
that does to the readings that are predicted is taken out of errors, as far as its size allows.
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
    """Errors within the class of sensors, each in its standard uncertainty.

    `moved` is what each does to readings, shape (signals * samples, errors), all measured signals
    one below the other. `shapes` holds per error the given reading and the course, SI, shape (n,),
    by which it is off; None for the zero error of a predicted reading.
    """

    moved: Array
    shapes: tuple[tuple[str, Array] | None, ...]

    @property
    def count(self) -> int:
        """Number of errors."""
        return len(self.shapes)

    def put_right(self, inputs: Mapping[str, Array], errors: Array) -> dict[str, Array]:
        """What was given, less errors, shape (n,), SI; `errors` shape (errors,)."""
        result = dict(inputs)
        for shape, size in zip(self.shapes, errors, strict=True):
            if shape is not None and size:
                result[shape[0]] = result[shape[0]] + size * shape[1]
        return result

    def given(self, errors: Array) -> Array:
        """Errors of given readings alone, others 0, shape (errors,)."""
        kept = [shape is not None for shape in self.shapes]
        return np.where(kept, errors, 0.0)


def no_drift(bench: SimulationProblem) -> Drift:
    """Sensors without errors."""
    return Drift(np.zeros((len(bench.signals) * len(bench.time), 0)), ())


def drift_of(
    bench: SimulationProblem, joined: tuple[str, ...], values: Mapping[str, float]
) -> Drift:
    """What each error within a class does."""
    record = bench.record
    columns: list[Array] = []
    shapes: list[tuple[str, Array] | None] = []
    plain = _stacked(bench, joined, values, record.inputs)
    spread = np.concatenate(
        [np.full(len(bench.time), np.nanstd(v)) for v in record.measured.values()]
    )
    for name, course in record.inputs.items():
        if name not in bench.balances(joined).inputs:
            continue
        u = systematic_u(bench.ruleset.signal_by_id[name], course)
        u = np.broadcast_to(u, course.shape)
        moved = _stacked(bench, joined, values, {**record.inputs, name: course + u})
        size = float(np.max(np.abs(moved - plain) / np.maximum(spread, 1e-300)))
        if size < limits.NOTABLE_DRIFT:
            continue
        for shape in (
            hats(bench.time, limits.DRIFT_KNOTS)
            if size > limits.LARGE_DRIFT
            else [np.ones(len(bench.time))]
        ):
            changed = {**record.inputs, name: course + u * shape}
            columns.append(_stacked(bench, joined, values, changed) - plain)
            shapes.append((name, u * shape))
    for i, (name, course) in enumerate(record.measured.items()):
        u = systematic_u(bench.ruleset.signal_by_id[name], course)
        own = np.zeros((len(record.measured), len(bench.time)))
        own[i] = np.nan_to_num(np.broadcast_to(u, course.shape))
        columns.append(own.ravel())
        shapes.append(None)
    return Drift(np.column_stack(columns), tuple(shapes))


def moved_again(
    drift: Drift,
    bench: SimulationProblem,
    joined: tuple[str, ...],
    values: Mapping[str, float],
    inputs: Mapping[str, Array],
) -> Drift:
    """The same errors, and what they do in another model: what runs over a rim is not
    stored. `inputs` have shape (n,), SI."""
    plain = _stacked(bench, joined, values, inputs)
    columns = [
        drift.moved[:, i]
        if shape is None
        else _stacked(bench, joined, values, {**inputs, shape[0]: inputs[shape[0]] + shape[1]})
        - plain
        for i, shape in enumerate(drift.shapes)
    ]
    return replace(drift, moved=np.column_stack(columns)) if columns else drift


def _stacked(
    bench: SimulationProblem,
    joined: tuple[str, ...],
    values: Mapping[str, float],
    inputs: Mapping[str, Array],
) -> Array:
    said = bench.simulate(joined, values, inputs=inputs)
    return np.concatenate([said.shown[n] for n in bench.signals])


def hats(over: Array, knots: int) -> list[Array]:
    """Piecewise linear shapes over the range of something that add up to one, shape (n,)."""
    ends = np.linspace(over.min(), over.max(), knots)
    return [np.interp(over, ends, row) for row in np.eye(knots)]


def errors_of_sensors(
    bench: SimulationProblem, ids: tuple[str, ...], values: Mapping[str, float]
) -> Array:
    """What errors of sensors within their class do to readings, stacked, shape (signals * samples,
    errors), SI. Those that move over a recording wander, as all else that a model is off by."""
    record, count = bench.record, len(bench.time)
    plain = _stacked(bench, ids, values, record.inputs)
    found = []
    for name in (n for n in record.inputs if n in bench.balances(ids).inputs):
        course = record.inputs[name]
        u = systematic_u(bench.ruleset.signal_by_id[name], course)
        found.append(_stacked(bench, ids, values, {**record.inputs, name: course + u}) - plain)
    for i, (name, course) in enumerate(record.measured.items()):
        own = np.zeros((len(record.measured), count))
        own[i] = np.nan_to_num(systematic_u(bench.ruleset.signal_by_id[name], course))
        found.append(own.ravel())
    return np.stack(found, axis=1)
