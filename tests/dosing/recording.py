"""A run as its sensors show it, and as it truly was."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rulec.prove.truth.sensors import TABLE_1, Sensing, read
from rulec.prove.truth.settled.solve import Operated, solve
from rulec.prove.truth.units import LITRE_PER_HOUR, Array
from tests.dosing.faults import check_faults, factor, terms_of
from tests.dosing.plant import LIQUID_TEMPERATURE
from tests.dosing.runs import Run

TANK_AREA = 0.5  # m2
TANK_FULL = 0.8  # m
TANK_REFILL = 0.3  # m; the level at which the tank is filled up again


@dataclass(frozen=True)
class Recording:
    """Columns by header, in trade units, of shape (n,): readings, NaN where a sensor is not fitted;
    degrees of all faults, and true flows (`Q_pump` is that of the pump before a leak)."""

    readings: Mapping[str, Array]
    truth: Mapping[str, Array]


def record(run: Run, sensing: Sensing = TABLE_1, seed: int = 1) -> Recording:
    """Simulate a run and read its sensors. Raises ValueError for an unknown fault, a degree out of
    range, a pump without flow, or if there is no operating point."""
    operation, rig = run.operation, run.plant.rig
    check_faults(run.plant, run.faults, operation.time.size)
    given = {f"{name}.n": speed for name, speed in operation.speed.items()}
    terms = (*run.plant.terms, *terms_of(run.plant, operation, run.faults))
    operated = Operated(rig, run.plant.values, given, terms)
    found = {**given, **solve(operated, backflow=run.backflow)}
    usual = np.full(operation.time.size, LIQUID_TEMPERATURE)
    for name in rig.pumps:
        found[f"{name}.T"] = operation.temperature.get(name, usual)
        found[f"{name}.l"] = _tank_level(operation.time, found[f"{name}.Q"])
    for name in rig.mixers:
        found[f"{name}.dp"] = np.where(operation.mixers_fitted, found[f"{name}.dp"], np.nan)
    readings = {"time [s]": operation.time}
    for place, sensor in rig.sensors.items():
        shown = read(sensor, place, found[place], sensing, seed)
        readings[f"{place} [{sensor.unit}]"] = shown * factor(run.faults, place, "high", "low")
    return Recording(readings, _truth(run, found))


def _tank_level(time: Array, flow: Array) -> Array:
    """Level, m, of a tank that is emptied by the net flow (a leak returns to the pump's suction
    side) and refilled when low; the head above the pump counts as compensated."""
    drawn = np.concatenate([[0.0], np.cumsum(flow[:-1] * np.diff(time))]) / TANK_AREA
    return TANK_FULL - np.mod(drawn, TANK_FULL - TANK_REFILL)


def _truth(run: Run, found: Mapping[str, Array]) -> dict[str, Array]:
    """Degrees of faults, and true flows of pumps, modules and mixers."""
    rig = run.plant.rig
    net = {name: found[f"{name}.Q"] for name in rig.pumps}
    flows = {f"{n}.Q_pump": q / (1.0 - run.faults.get(f"{n}.leakage", 0.0)) for n, q in net.items()}
    flows |= {f"{name}.Q": flow for name, flow in net.items()}
    mixed = np.stack(list(net.values()), 1) @ rig.feeds
    flows |= {f"{name}.Q": mixed[:, k] for k, name in enumerate(rig.mixers)}
    columns = {"time [s]": run.operation.time}
    columns |= {f"{name} [1]": degree for name, degree in run.faults.items()}
    return columns | {f"{name} [l/h]": flow / LITRE_PER_HOUR for name, flow in flows.items()}
