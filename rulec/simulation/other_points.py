"""Whether a plant has a second operating point: a search from other starting points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.simulation import limits
from rulec.simulation.equations import Equations
from rulec.simulation.newton import Index, Systems, newton
from rulec.simulation.simulate import Simulated, simulate_with


@dataclass(frozen=True)
class OtherPoint:
    """A row in which a signal could have another value than the predicted one; SI."""

    row: int
    signal: str
    predicted: float
    also: float


def other_point(
    equations: Equations,
    given: Mapping[str, Array],
    degrees: Mapping[str, Array | float],
    simulated: Simulated,
) -> OtherPoint | None:
    """The first other operating point found; None does not prove that there is none."""

    def damped(systems: Systems, start: Array, index: Index) -> tuple[Array, Array]:
        at, solved = newton(systems, start, np.ones(len(start)), index)
        return at, np.where(solved, 1.0, 0.0)

    rows = np.flatnonzero(simulated.solved)
    if not rows.size or not equations.predicted:
        return None
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, limits.OTHER_ROWS).astype(int))]
    found = {name: simulated.values[name][rows] for name in equations.predicted}
    some_given, some_degrees = (
        {name: np.broadcast_to(v, simulated.solved.shape)[rows] for name, v in table.items()}
        for table in (given, degrees)
    )
    for factor in limits.OTHER_STARTS:
        start = {}
        for name, values in found.items():
            zero = equations.ruleset.signal_by_id[name].offset
            start[name] = zero + factor * (values - zero)
        other = simulate_with(equations, some_given, some_degrees, solve=damped, start=start)
        for i in np.flatnonzero(_possible(equations, other)):
            gaps = {n: abs(other.values[n][i] / values[i] - 1.0) for n, values in found.items()}
            name = max(gaps, key=lambda n: gaps[n])
            if gaps[name] > limits.OTHER_POINT:
                also = float(other.values[name][i])
                return OtherPoint(int(rows[i]), name, float(found[name][i]), also)
    return None


def _possible(equations: Equations, points: Simulated) -> np.ndarray:
    """Solved, with readings within the ranges of the sensors and of the equations."""
    possible = points.solved.copy()
    for name in equations.predicted:
        signal, values = equations.ruleset.signal_by_id[name], points.values[name]
        with np.errstate(invalid="ignore"):
            for low in (signal.lowest, signal.minimum):
                possible &= True if low is None else values >= low
            possible &= True if signal.highest is None else values <= signal.highest
    return possible
