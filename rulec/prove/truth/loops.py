"""Stationary flow in any network of pumps and losses: splits, parallel branches, loops.

Unknown are the flow of every branch, the pressure a pump adds, and the pressure of every node; the
equations are the laws of the branches and continuity at the nodes. Newton's method with a halved
step where the whole one does not help. Nodes are names; `OUTSIDE` is at zero pressure.
Values are in bar, l/h, rpm and W, as a recording has them.

Source: own derivation; laws and values from method.md, section 5 (progressive cavity pump, dosing
line, mixer).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .units import Array

OUTSIDE = "outside"
ITERATIONS = 60
TOLERANCE = 1e-12


@dataclass(frozen=True)
class Resistance:
    """A branch that loses `quadratic` Q |Q|; bar/(l/h)2. `shown`: a sensor gives its loss."""

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


def readings(
    branches: Mapping[str, Branch], faults: Mapping[str, float] | None = None
) -> dict[str, float]:
    """What the sensors of a network show, as columns such as ``A.dp [bar]``.

    `faults` maps names such as ``A.leakage``, ``M.clogging``, ``A.dp.low`` to degrees.
    """
    degrees = dict(faults or {})
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
    """Flow of every branch (l/h) and pressure rise of every pump (bar).

    Raises RuntimeError where Newton's method finds no operating point.
    """
    system = _System(branches, degrees)
    x = system.start()
    error, slope = system.equations(x)
    for _ in range(ITERATIONS):
        step = np.linalg.lstsq(slope, error, rcond=None)[0]
        part = 1.0
        while True:
            tried, new_slope = system.equations(x - part * step)
            if np.linalg.norm(tried) < np.linalg.norm(error) or part < 1e-4:
                break
            part /= 2.0
        x, error, slope = x - part * step, tried, new_slope
        if np.max(np.abs(error)) < TOLERANCE:
            return system.flows(x), system.rises(x)
    raise RuntimeError(f"no operating point; largest error {np.max(np.abs(error)):.1e}")


def _change(degrees: Mapping[str, float], sensor: str) -> float:
    return (1.0 + degrees.get(f"{sensor}.high", 0.0)) * (1.0 - degrees.get(f"{sensor}.low", 0.0))


def _friction(degrees: Mapping[str, float], name: str) -> float:
    clogged, widened = (degrees.get(f"{name}.{kind}", 0.0) for kind in ("clogging", "widening"))
    return (1.0 + clogged) * (1.0 - widened)


def _quadratic(branch: Resistance, name: str, degrees: Mapping[str, float]) -> float:
    return branch.quadratic * _friction(degrees, name)


class _System:
    """Equations over x: flows in units of 500 l/h, rises of pumps and node pressures in bar."""

    UNIT = 500.0

    def __init__(self, branches: Mapping[str, Branch], degrees: Mapping[str, float]) -> None:
        self.branches, self.degrees = branches, degrees
        nodes = dict.fromkeys(n for b in branches.values() for n in (b.tail, b.head))
        pumps = [name for name, b in branches.items() if isinstance(b, DosingBranch)]
        self.nodes = [n for n in nodes if n != OUTSIDE]
        keys = [("Q", n) for n in branches] + [("dp", n) for n in pumps]
        keys += [("p", n) for n in self.nodes]
        self.at = {key: i for i, key in enumerate(keys)}

    def start(self) -> Array:
        return np.ones(len(self.at))

    def flows(self, x: Array) -> dict[str, float]:
        return {n: float(x[i]) * self.UNIT for (kind, n), i in self.at.items() if kind == "Q"}

    def rises(self, x: Array) -> dict[str, float]:
        return {n: float(x[i]) for (kind, n), i in self.at.items() if kind == "dp"}

    def equations(self, x: Array) -> tuple[Array, Array]:
        """Errors of all equations and their slopes by x."""
        size, row = len(self.at), 0
        error, slope = np.zeros(size), np.zeros((size, size))
        for name, branch in self.branches.items():
            q = self.at["Q", name]
            if isinstance(branch, DosingBranch):
                dp = self.at["dp", name]
                kept = (1.0 - self.degrees.get(f"{name}.leakage", 0.0)) / self.UNIT
                slip = 2.0 * x[dp] * abs(x[dp])
                error[row] = x[q] - kept * (0.59 * branch.speed - 6.0 - slip)
                slope[row, q], slope[row, dp] = 1.0, kept * 4.0 * abs(x[dp])
                row += 1
                static, quadratic = 0.05, 5.2e-6 * _friction(self.degrees, name)
                error[row] -= x[dp]
                slope[row, dp] = -1.0
            else:
                static, quadratic = 0.0, _quadratic(branch, name, self.degrees)
            quadratic *= self.UNIT**2
            error[row] += static + quadratic * x[q] * abs(x[q])
            slope[row, q] = 2.0 * quadratic * abs(x[q])
            for node, sign in ((branch.head, 1.0), (branch.tail, -1.0)):
                if node != OUTSIDE:
                    error[row] += sign * x[self.at["p", node]]
                    slope[row, self.at["p", node]] += sign
            row += 1
        for node in self.nodes:
            for name, branch in self.branches.items():
                sign = float(branch.head == node) - float(branch.tail == node)
                error[row] += sign * x[self.at["Q", name]]
                slope[row, self.at["Q", name]] += sign
            row += 1
        return error, slope
