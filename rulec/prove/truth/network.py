"""Stationary operating point: every pump against its line and the mixers it feeds.

Unknown is the inner flow q of each pump. From it follow the net flow (1 - leak) q, the flow of
every mixer (continuity), all losses, and so the pressure the pump must deliver; Newton's method
drives the imbalance of all pump laws to zero, for all samples at once.
"""

from dataclasses import dataclass

import numpy as np

from .plant import Plant
from .units import Array

ITERATIONS = 50
TOLERANCE = 1e-12  # last Newton step relative to the largest flow of the sample


@dataclass(frozen=True)
class Condition:
    """State of the plant in each sample, faults included.

    Attributes
    ----------
    speed : ndarray, shape (n, modules), rev/s
    leak : ndarray, shape (n, modules), 1; share of the pump's flow that returns
    line_quadratic : ndarray, shape (n, modules), Pa/(m3/s)2
    mixer_quadratic : ndarray, shape (n, mixers), Pa/(m3/s)2
    """

    speed: Array
    leak: Array
    line_quadratic: Array
    mixer_quadratic: Array


@dataclass(frozen=True)
class OperatingPoint:
    """Solution; arrays have shape (n, modules) or (n, mixers).

    Attributes
    ----------
    pump_flow, flow : ndarray, m3/s; before and behind the leak
    pressure : ndarray, Pa; difference across the pump
    power : ndarray, W
    mixer_flow, mixer_pressure : ndarray, m3/s and Pa
    """

    pump_flow: Array
    flow: Array
    pressure: Array
    power: Array
    mixer_flow: Array
    mixer_pressure: Array


def solve(plant: Plant, condition: Condition, *, backflow: bool = False) -> OperatingPoint:
    """Solve the coupled network for all samples.

    `backflow`: whether the laws of the pumps hold for backflow, too.

    Raises
    ------
    RuntimeError
        No convergence to TOLERANCE.
    ValueError
        A pump cannot overcome its back-pressure: its laws do not describe backflow, unless
        `backflow` is set.

    Source: own derivation; continuity at every mixer, pressure balance along every path.
    """
    pumps = [module.pump for module in plant.modules.values()]
    pump_flow = np.stack([p.free_flow(condition.speed[:, k]) for k, p in enumerate(pumps)], 1)
    error = np.full(len(pump_flow), np.inf)
    for _ in range(ITERATIONS):
        step = _newton_step(plant, condition, pump_flow)
        pump_flow = pump_flow - step
        error = np.abs(step).max(axis=1) / np.abs(pump_flow).max(axis=1)
        if np.all(error <= TOLERANCE):
            break
    _check(plant, pump_flow, error, backflow)
    return _operating_point(plant, condition, pump_flow)


def _operating_point(plant: Plant, condition: Condition, pump_flow: Array) -> OperatingPoint:
    flow = (1.0 - condition.leak) * pump_flow
    mixer_flow = flow @ plant.feeds
    mixer_pressure = condition.mixer_quadratic * mixer_flow * np.abs(mixer_flow)
    static = np.array([module.line.static for module in plant.modules.values()])
    line_pressure = static + condition.line_quadratic * flow * np.abs(flow)
    pressure = line_pressure + mixer_pressure @ plant.feeds.T
    power = np.stack(
        [
            module.pump.power(condition.speed[:, k], pump_flow[:, k], pressure[:, k])
            for k, module in enumerate(plant.modules.values())
        ],
        1,
    )
    return OperatingPoint(pump_flow, flow, pressure, power, mixer_flow, mixer_pressure)


def _newton_step(plant: Plant, condition: Condition, pump_flow: Array) -> Array:
    """Excess of all inner flows, m3/s; shape (n, modules)."""
    point = _operating_point(plant, condition, pump_flow)
    laws = [
        module.pump.imbalance(condition.speed[:, k], pump_flow[:, k], point.pressure[:, k])
        for k, module in enumerate(plant.modules.values())
    ]
    imbalance, by_flow, by_pressure = (np.stack(part, 1) for part in zip(*laws, strict=True))
    jacobian = by_pressure[:, :, None] * _pressure_slope(plant, condition, point)
    diagonal = np.arange(len(laws))
    jacobian[:, diagonal, diagonal] += by_flow
    return np.linalg.solve(jacobian, imbalance[:, :, None])[:, :, 0]


def _pressure_slope(plant: Plant, condition: Condition, point: OperatingPoint) -> Array:
    """Derivative of each pressure by each inner flow; shape (n, modules, modules)."""
    mixer_slope = 2.0 * condition.mixer_quadratic * np.abs(point.mixer_flow)
    slope = (plant.feeds * mixer_slope[:, None, :]) @ plant.feeds.T
    diagonal = np.arange(len(plant.modules))
    slope[:, diagonal, diagonal] += 2.0 * condition.line_quadratic * np.abs(point.flow)
    return slope * (1.0 - condition.leak)[:, None, :]


def _check(plant: Plant, pump_flow: Array, error: Array, backflow: bool) -> None:
    """Raise an error with sample and module if a solution is no operating point."""
    bad = np.flatnonzero(~(error <= TOLERANCE))  # ~(<=) also catches NaN
    if bad.size:
        raise RuntimeError(
            f"operating point not found for {bad.size} of {error.size} samples, first "
            f"{bad[0]}: relative step {error[bad[0]]:.1e} after {ITERATIONS} iterations"
        )
    for name, flow in zip(plant.modules, pump_flow.T, strict=True):
        if not backflow and np.any(flow <= 0.0):
            raise ValueError(
                f"pump of module '{name}' cannot overcome its back-pressure in sample "
                f"{np.argmax(flow <= 0.0)}"
            )
