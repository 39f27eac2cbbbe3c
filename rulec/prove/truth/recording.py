"""The columns of a recording and of its truth, from a run; CSV."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import isnan
from pathlib import Path

import numpy as np

from .faults import check_faults, condition_of, factor
from .network import OperatingPoint, solve
from .plant import LIQUID_TEMPERATURE
from .runs import Run
from .sensors import DOSING_SIGNALS, MIXER_SIGNALS, TABLE_1, Sensing, Sensor, read
from .units import LITRE_PER_HOUR, Array

TANK_AREA = 0.5  # m2
TANK_FULL = 0.8  # m
TANK_REFILL = 0.3  # m; the level at which the tank is filled up again


@dataclass(frozen=True)
class Recording:
    """Columns by header, in trade units; each ndarray, shape (n,).

    Attributes
    ----------
    readings : `time [s]` and `<instance>.<signal> [unit]`; NaN where a sensor is not fitted
    truth : `time [s]`, the degree of every fault of the run, the true flows (`Q_pump` is the
        flow of the pump before a leak)
    """

    readings: Mapping[str, Array]
    truth: Mapping[str, Array]


def record(run: Run, sensing: Sensing = TABLE_1, seed: int = 1) -> Recording:
    """Simulate a run and read its sensors.

    Raises ValueError for an unknown fault, a degree out of range or a pump without flow, and
    RuntimeError if there is no operating point.
    """
    operation = run.operation
    check_faults(run.plant, run.faults, operation.time.size)
    condition = condition_of(run.plant, operation, run.faults)
    point = solve(run.plant, condition, backflow=run.backflow)
    readings = {"time [s]": operation.time}
    for place, sensor, value in _signals(run, point):
        shown = read(sensor, place, value, sensing, seed)
        readings[f"{place} [{sensor.unit}]"] = shown * factor(run.faults, place, "high", "low")
    return Recording(readings, _truth(run, point))


def write_csv(path: Path, columns: Mapping[str, Array], digits: int = 6) -> None:
    """Write columns with a fixed number of significant digits; NaN is an empty cell."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [",".join("" if isnan(v) else f"{v:.{digits}g}" for v in row) for row in rows]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n", encoding="utf-8")


def _signals(run: Run, point: OperatingPoint) -> Iterator[tuple[str, Sensor, Array]]:
    """Place, sensor and true value (SI) of every signal, in column order."""
    usual = np.full(run.operation.time.size, LIQUID_TEMPERATURE)
    for k, (name, module) in enumerate(run.plant.modules.items()):
        values = {
            "n": run.operation.speed[name],
            "dp": point.pressure[:, k],
            "P_el": point.power[:, k],
            "Q": point.flow[:, k],
            "T": run.operation.temperature.get(name, usual),
            "l": _tank_level(run.operation.time, point.flow[:, k]),
        }
        for signal, sensor in DOSING_SIGNALS.items():
            gear = module.gear_ratio if signal == "n" else 1.0
            yield f"{name}.{signal}", replace(sensor, bound=sensor.bound / gear), values[signal]
    for k, name in enumerate(run.plant.mixers):
        fitted = np.where(run.operation.mixers_fitted, point.mixer_pressure[:, k], np.nan)
        yield f"{name}.dp", MIXER_SIGNALS["dp"], fitted


def _tank_level(time: Array, flow: Array) -> Array:
    """Level, m, of a tank that is emptied by the net flow and refilled when low.

    A leak returns to the pump's suction side, so only the net flow leaves. The level does not
    change the static part of the line: the head above the pump counts as compensated.
    """
    drawn = np.concatenate([[0.0], np.cumsum(flow[:-1] * np.diff(time))]) / TANK_AREA
    return TANK_FULL - np.mod(drawn, TANK_FULL - TANK_REFILL)


def _truth(run: Run, point: OperatingPoint) -> dict[str, Array]:
    """Degrees of faults, and true flows of pumps, modules and mixers."""
    modules, mixers = run.plant.modules, run.plant.mixers
    flows = {f"{name}.Q_pump": point.pump_flow[:, k] for k, name in enumerate(modules)}
    flows |= {f"{name}.Q": point.flow[:, k] for k, name in enumerate(modules)}
    flows |= {f"{name}.Q": point.mixer_flow[:, k] for k, name in enumerate(mixers)}
    columns = {"time [s]": run.operation.time}
    columns |= {f"{name} [1]": degree for name, degree in run.faults.items()}
    return columns | {f"{name} [l/h]": flow / LITRE_PER_HOUR for name, flow in flows.items()}
