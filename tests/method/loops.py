"""Stationary flow in any network of pumps and losses: splits, parallel branches, loops.

Unknown are the flow of every branch, the pressure rise of every pump, and the pressure of every
node; the equations are the laws of the branches and continuity at the nodes. Nodes are names;
`OUTSIDE` is at zero pressure. Values are in bar, l/h, rpm and W, as in a recording.

Source: own derivation; laws and values from method.md, section 5 (progressive cavity pump, dosing
line, mixer).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import root

from rulec.prove.truth.units import Array

OUTSIDE = "outside"
TOLERANCE, ACCEPTED = 1e-14, 1e-10
UNIT = 500.0
"""l/h; flows are solved in this unit and pressures in bar, so that all are of order one."""


@dataclass(frozen=True)
class Resistance:
    """A branch that loses `quadratic` Q |Q|; bar/(l/h)2. `shown`: a sensor measures its loss."""

    tail: str
    head: str
    quadratic: float = 0.0
    shown: bool = True


@dataclass(frozen=True)
class DosingBranch:
    """A progressive cavity pump at a speed (rpm), with its line.

    Flow of the pump: 0.6 n - 6 - 0.010 n - 2 dp |dp| with V = 10 ml/rev; its line loses
    0.05 bar + 5.2e-6 Q |Q|; power: 25 + 0.095 n + 0.6 n dp / 36 / 0.70.
    """

    tail: str
    head: str
    speed: float = 900.0


Branch = Resistance | DosingBranch


def readings(branches: Mapping[str, Branch], degrees: Mapping[str, float]) -> dict[str, float]:
    """Columns such as ``A.dp [bar]``, with faults such as ``M.clogging`` of some degrees."""
    flow, rise = solve(branches, degrees)
    shown: dict[str, float] = {}
    for name, branch in branches.items():
        if isinstance(branch, DosingBranch):
            n, dp = branch.speed, rise[name]
            shown[f"{name}.n [rpm]"] = n
            shown[f"{name}.dp [bar]"] = dp * _change(degrees, f"{name}.dp")
            power = 25.0 + 0.095 * n + 0.6 * n * dp / 36.0 / 0.70
            shown[f"{name}.P_el [W]"] = power * _change(degrees, f"{name}.P_el")
        elif branch.shown:
            loss = _quadratic(branch, name, degrees) * flow[name] * abs(flow[name])
            shown[f"{name}.dp [bar]"] = loss * _change(degrees, f"{name}.dp")
    return shown


def solve(
    branches: Mapping[str, Branch], degrees: Mapping[str, float]
) -> tuple[dict[str, float], dict[str, float]]:
    """The flow of every branch (l/h) and the pressure rise of every pump (bar)."""
    pumps = [name for name, branch in branches.items() if isinstance(branch, DosingBranch)]
    ends = dict.fromkeys(n for b in branches.values() for n in (b.tail, b.head))
    nodes = [n for n in ends if n != OUTSIDE]
    cuts = np.cumsum([len(branches), len(pumps)])

    def named(x: Array) -> list[dict[str, float]]:
        """Flows in UNIT, rises of pumps and pressures of nodes, bar."""
        parts = zip((branches, pumps, nodes), np.split(x, cuts), strict=True)
        return [dict(zip(names, v.tolist(), strict=True)) for names, v in parts]

    def errors(x: Array) -> list[float]:
        flow, rise, pressure = named(x)
        pressure[OUTSIDE] = 0.0
        found = []
        for name, branch in branches.items():
            static, quadratic, added = 0.0, 0.0, 0.0
            if isinstance(branch, DosingBranch):
                added = rise[name]
                kept = (1.0 - degrees.get(f"{name}.leakage", 0.0)) / UNIT
                slip = 2.0 * added * abs(added)
                found.append(flow[name] - kept * (0.59 * branch.speed - 6.0 - slip))
                static, quadratic = 0.05, 5.2e-6 * _friction(degrees, name)
            else:
                quadratic = _quadratic(branch, name, degrees)
            loss = static + quadratic * UNIT**2 * flow[name] * abs(flow[name])
            found.append(pressure[branch.head] - pressure[branch.tail] + loss - added)
        for node in nodes:
            into = sum(flow[n] for n, b in branches.items() if b.head == node)
            found.append(into - sum(flow[n] for n, b in branches.items() if b.tail == node))
        return found

    solved = root(errors, np.ones(cuts[-1] + len(nodes)), method="lm", tol=TOLERANCE)
    assert np.max(np.abs(solved.fun)) < ACCEPTED, "no operating point"
    flow, rise, _ = named(solved.x)
    return {name: UNIT * q for name, q in flow.items()}, rise


def _change(degrees: Mapping[str, float], sensor: str) -> float:
    return (1.0 + degrees.get(f"{sensor}.high", 0.0)) * (1.0 - degrees.get(f"{sensor}.low", 0.0))


def _friction(degrees: Mapping[str, float], name: str) -> float:
    clogged, widened = (degrees.get(f"{name}.{kind}", 0.0) for kind in ("clogging", "widening"))
    return (1.0 + clogged) * (1.0 - widened)


def _quadratic(branch: Resistance, name: str, degrees: Mapping[str, float]) -> float:
    return branch.quadratic * _friction(degrees, name)
