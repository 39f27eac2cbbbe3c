"""Ready runs: fault-free, stepped faults, operating points, calibration; one sample per second.

Between plateaus speeds and valves approach their settings. The liquid follows within milliseconds,
so every sample is an operating point of its own (quasi-stationary). A sensor fault jumps, because
nothing moves. Two runs have physics that the plain laws leave out: slip that follows the
temperature, and a frame that shakes in a band of speeds.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rulec.prove.truth.settled.drive import SPEED_TIME, approach
from rulec.prove.truth.units import RPM, Array
from tests.dosing.faults import Faults
from tests.dosing.plant import LIQUID_TEMPERATURE, Duty, Operation, Plant

DWELL = 10  # samples per plateau, s
# Steps back to zero between the plateaus: the plant is healthy again after each fault.
DEGREES = (0.0, 0.2, 0.0, 0.4, 0.0, 0.6, 0.0, 0.0)
# Part of each speed range that operation uses: every pump can still deliver with a fault of the
# largest degree, and readings stay inside the range of the calibration.
LOWEST, HIGHEST = 0.25, 0.85

Speeds = Mapping[str, float]  # of each module, rev/s


@dataclass(frozen=True)
class Run:
    """A plant, its operation and its faults; `backflow`: its pumps' laws hold for that, too."""

    plant: Plant
    operation: Operation
    faults: Faults = field(default_factory=dict)
    backflow: bool = False


def healthy_run(plant: Plant, samples: int = 60) -> Run:
    """Fault-free at nominal speed."""
    return Run(plant, _nominal(plant, samples))


def fault_replay(plant: Plant, fault: str, degrees: Sequence[float] = DEGREES) -> Run:
    """Return one fault in plateaus at nominal speed. Source: method.md, section 4."""
    degree = np.repeat(np.asarray(degrees, dtype=np.float64), DWELL)
    return Run(plant, _nominal(plant, degree.size), {fault: degree})


def operating_points(plant: Plant, count: int) -> list[Speeds]:
    """Return the nominal speeds, then others spread evenly over the used part of the ranges."""
    points: list[Speeds] = [{name: module.speed for name, module in plant.modules.items()}]
    position = [LOWEST + _spread(count, k) * (HIGHEST - LOWEST) for k in range(len(plant.modules))]
    for i in range(1, count):
        modules = enumerate(plant.modules.items())
        points.append({name: float(_speed_at(m, position[k][i])) for k, (name, m) in modules})
    return points


def visiting_run(
    plant: Plant,
    points: Sequence[Speeds],
    faults: Mapping[str, float],
    lead_in: int = 0,
    dwell: int = DWELL,
) -> Run:
    """Visit operating points for `dwell` samples each, with all faults present, behind `lead_in`
    samples without fault at the first point."""
    lengths = [lead_in, *[dwell] * len(points)]
    visited = [points[0], *points]
    speed = {
        name: np.repeat([float(point[name]) for point in visited], lengths)
        for name in plant.modules
    }
    present = np.repeat([0.0, *[1.0] * len(points)], lengths)
    operation = Operation(np.arange(present.size, dtype=np.float64), speed)
    return Run(plant, operation, {name: degree * present for name, degree in faults.items()})


def calibration_run(plant: Plant) -> Run:
    """Return a fault-free run as a maker does it, with the flow meter as reference.

    First every module runs alone on a bench without mixers: each speed with each throttle, closed
    further at lower speed, so that the pressure does not follow the speed. Then all run on the
    plant without throttle, at their slowest, at their fastest, and with speeds spread over the
    ranges, so that all flows of mixers vary, and a module's back-pressure does not follow its flow.
    """
    speeds, mixer_points, dwell = 5, 15, DWELL
    settings = min(len(module.throttles) for module in plant.modules.values())
    position = np.tile(np.linspace(0.0, 1.0, speeds), settings)
    bench = position.size * dwell
    speed, throttle = {}, {}
    for k, (name, module) in enumerate(plant.modules.items()):
        on_bench = _speed_at(module, position)
        on_plant = _speed_at(module, np.concatenate([[0.0, 1.0], _spread(mixer_points - 2, k)]))
        setting = np.repeat(module.throttles[:settings], speeds)
        closed = setting * plant.values[f"{name}.k2"] * (module.fastest / on_bench) ** 2
        speed[name] = np.repeat(np.concatenate([on_bench, on_plant]), dwell)
        throttle[name] = np.repeat(np.concatenate([closed, np.zeros(mixer_points)]), dwell)
    time = np.arange(bench + mixer_points * dwell, dtype=np.float64)
    return Run(plant, Operation(time, speed, throttle, on_bench=time < bench))


def _nominal(plant: Plant, samples: int) -> Operation:
    speed = {name: np.full(samples, module.speed) for name, module in plant.modules.items()}
    return Operation(np.arange(samples, dtype=np.float64), speed)


def _speed_at(module: Duty, position: Array) -> Array:
    """Speed, rev/s, at positions 0 (slowest) to 1 (fastest)."""
    return module.slowest + position * (module.fastest - module.slowest)


def _spread(points: int, axis: int) -> Array:
    """Evenly spread coordinates in 0..1, a sequence for each axis. Source: Kronecker."""
    prime = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29)[axis]
    position: Array = np.mod(0.5 + np.arange(points) * math.sqrt(prime), 1.0)
    return position


MOVED_BY_A_VALVE = (".leakage", ".clogging", ".widening")

VALVE_TIME = 1.5
"""Time constant, s; assumed: a motorised valve of a small rig."""


def settling(run: Run) -> Run:
    """Return the run with its values as settings that speeds and valves approach. Raises ValueError
    for a run on the bench, whose throttle is not there afterwards."""
    operation = run.operation
    if operation.on_bench is not None:
        raise ValueError("a run on the maker's bench is set up point by point, without transients")
    speed = {
        name: approach(operation.time, value, SPEED_TIME) for name, value in operation.speed.items()
    }
    faults = {
        name: approach(operation.time, degree, VALVE_TIME)
        if name.endswith(MOVED_BY_A_VALVE)
        else degree
        for name, degree in run.faults.items()
    }
    return Run(run.plant, replace(operation, speed=speed), faults)


RISE = 0.03
"""Rise of the slip per kelvin: oil loses about 3 % of its viscosity per kelvin [assumed]."""

WARMEST = 30.0
"""Largest rise above the usual temperature, K."""

PEAK, WIDTH = 850.0 * RPM, 60.0 * RPM
"""Speed at which the frame shakes most, and the distance at which it shakes a third of that; rev/s
[assumed]."""

TAKEN = 25.0
"""Power of the shaking at its peak, W [assumed]."""

POINTS, STAY = 24, 12
"""Operating points of a run, and samples at each."""


def warm_run(plant: Plant, module: str = "A") -> Run:
    """Visit operating points while a module's liquid warms up and cools down: slip driven by
    pressure follows 1/viscosity."""
    run = _tour(plant)
    time = run.operation.time
    temperature = LIQUID_TEMPERATURE + WARMEST * np.sin(np.pi * time / time[-1]) ** 2
    factor = np.exp(RISE * (temperature - LIQUID_TEMPERATURE))
    slip = f"{module}.C2"
    warm = plant.with_values({slip: plant.values[slip] * factor})
    return Run(warm, replace(run.operation, temperature={module: temperature}))


def taken(speed: Array) -> Array:
    """Return the power of the shaking, W, at speeds, rev/s; shape (n,)."""
    power: Array = TAKEN * np.exp(-(((speed - PEAK) / WIDTH) ** 2))
    return power


def shaken_run(plant: Plant) -> Run:
    """Visit operating points while the frame below module B shakes and takes power."""
    run = _tour(plant)
    idle = plant.values["B.P0"] + taken(run.operation.speed["B"])
    return Run(plant.with_values({"B.P0": idle}), run.operation)


def _tour(plant: Plant) -> Run:
    return settling(visiting_run(plant, operating_points(plant, POINTS), {}, dwell=STAY))
