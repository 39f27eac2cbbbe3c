"""Readings of a plant with given faults, from its ruleset alone.

The ruleset's `undo` plan gives every estimate of a flow with faults undone. The readings of a
plant are those at which all estimates of a module agree on one flow and the flows balance at the
junctions, so the equations that diagnose also simulate. Errors of sensors are not in here, see
`runtime/sensing.py`.

Source: own derivation; Newton's method along a path of easier problems (runtime/newton.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.equations import Equations, SimulationRefused
from runtime.newton import follow
from runtime.operating_points import OperatingPoints
from runtime.plan import Array
from runtime.ruleset import Ruleset
from runtime.unknowns import equations_of

__all__ = ["Simulated", "SimulationRefused", "simulate", "simulate_with"]

Given = Mapping[str, Array | float]


@dataclass(frozen=True)
class Simulated:
    """Operating points, n of them.

    Attributes
    ----------
    values : per signal that some observer reads an array, shape (n,), SI, without sensor errors;
        NaN where there is no operating point.
    flows : per module with observers an array, shape (n,), m3/s.
    solved : shape (n,).
    why : per sample what stands against an operating point; empty where there is one.
    """

    values: Mapping[str, Array]
    flows: Mapping[str, Array]
    solved: NDArray[np.bool_]
    why: tuple[str, ...]


def simulate(
    ruleset: Ruleset, given: Given, degrees: Given, offsets: Given | None = None
) -> Simulated:
    """Find the readings of a plant.

    Parameters
    ----------
    given : per input (and per reading that no observer determines) an array, shape (n,), or a
        number; SI. Absent ones stay at the reference point. A given reading is what its sensor
        shows, also where a fault makes it wrong.
    degrees : per fault id its degree, shape (n,) or a number. Several faults may act at once.
    offsets : per observer id how far its law is off the truth, m3/s.

    Raises
    ------
    SimulationRefused
        The plant cannot be simulated, or a name or number is not one of this plant.
    """
    return simulate_with(equations_of(ruleset), given, degrees, offsets)


def simulate_with(
    equations: Equations, given: Given, degrees: Given, offsets: Given | None = None
) -> Simulated:
    """As `simulate`, where the equations of the plant are known already."""
    offsets = offsets or {}
    _check(equations, given, degrees, offsets)
    arrays = [
        np.asarray(v, dtype=float) for part in (given, degrees, offsets) for v in part.values()
    ]
    (n,) = np.broadcast_shapes((1,), *(a.shape for a in arrays))
    points = OperatingPoints(
        equations,
        {s.id: _spread(given.get(s.id, s.reference), n) for s in equations.given_signals},
        {name: _spread(degree, n) for name, degree in degrees.items()},
        np.array([_spread(offsets.get(o.id, 0.0), n) for o in equations.ruleset.observers]),
    )
    at, reached = follow(points, np.tile(equations.start, (n, 1)))
    return _result(points, at, reached)


def _spread(value: Array | float, n: int) -> Array:
    return np.broadcast_to(np.asarray(value, dtype=float), (n,))


def _check(equations: Equations, given: Given, degrees: Given, offsets: Given) -> None:
    """Refuse names and numbers that are none of this plant."""
    ruleset = equations.ruleset
    kinds = (
        ("input", given, equations.given),
        ("fault", degrees, ruleset.fault_by_id),
        ("observer", offsets, ruleset.observer_by_id),
    )
    for kind, table, known in kinds:
        for name, value in table.items():
            if name not in known:
                raise SimulationRefused(
                    f"{ruleset.plant} has no {kind} '{name}'; it has {', '.join(known)}"
                )
            if not np.all(np.isfinite(value)):
                raise SimulationRefused(f"{name}: not every value is a number")
    for name, value in degrees.items():
        fault = ruleset.fault_by_id[name]
        if np.any(np.asarray(value) < fault.lowest) or np.any(np.asarray(value) > fault.highest):
            raise SimulationRefused(
                f"{name}: its degree lies between {fault.lowest:g} and {fault.highest:g}"
            )


def _result(points: OperatingPoints, at: Array, reached: Array) -> Simulated:
    equations = points.equations
    readings = len(equations.predicted)
    flows = at[:, readings:] * equations.flow_scales
    solved = (reached == 1.0) & (flows > 0).all(axis=1)
    values: dict[str, Array] = {}
    for i, (name, scale) in enumerate(zip(equations.predicted, equations.scales, strict=True)):
        values[name] = np.where(solved, at[:, i] * scale, np.nan)
    values.update({name: np.where(solved, v, np.nan) for name, v in points.given.items()})
    return Simulated(
        {s.id: values[s.id] for s in equations.ruleset.signals if s.id in values},
        {m: np.where(solved, flows[:, i], np.nan) for i, m in enumerate(equations.flows)},
        solved,
        tuple(
            "" if solved[i] else _why(points, flows[i], float(reached[i]), i)
            for i in range(len(solved))
        ),
    )


def _why(points: OperatingPoints, flows: Array, reached: float, sample: int) -> str:
    """What stands against an operating point."""
    equations = points.equations
    what = [f"{name} {degree[sample]:g}" for name, degree in points.degrees.items()]
    for signal in equations.given_signals:
        shown = (points.given[signal.id][sample] - signal.offset) / signal.factor
        what.append(f"{signal.id} {shown:.4g} {signal.unit}")
    text = f"no operating point at {', '.join(what)}: "
    if reached < 0:
        return text + "not even the reference point solves these equations"
    part = flows / equations.flow_scales
    worst = int(np.argmin(part))
    flow = f"{equations.flows[worst]} carries {100.0 * part[worst]:.2g} % of its reference flow"
    if reached == 1.0:
        return text + flow
    way = f"the way there from the reference point ends at {100.0 * reached:.4g} %"
    return f"{text}{way}, where {flow}"
