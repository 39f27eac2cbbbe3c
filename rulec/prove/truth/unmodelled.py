"""Physics that the plain laws leave out: slip that follows the temperature, a frame that shakes in
a band of speeds, a liquid whose viscosity changes during the run."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .faults import Faults
from .plant import LIQUID_TEMPERATURE, Operation, Plant
from .pumps import Displacement
from .runs import Run, operating_points, visiting_run
from .transients import settling
from .units import RPM, Array

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
    pump = plant.modules[module].pump
    assert isinstance(pump, Displacement)
    slips = {s: getattr(pump, s) * factor for s in ("slip_linear", "slip_quadratic")}
    operation = replace(run.operation, temperature={module: temperature})
    return Run(_with_pump(plant, module, replace(pump, **slips)), operation)


def taken(speed: Array) -> Array:
    """Return the power of the shaking, W, at speeds, rev/s; shape (n,)."""
    power: Array = TAKEN * np.exp(-(((speed - PEAK) / WIDTH) ** 2))
    return power


def shaken_run(plant: Plant) -> Run:
    """Visit operating points while the frame below module B shakes and takes power."""
    run, pump = _tour(plant), plant.modules["B"].pump
    assert isinstance(pump, Displacement)
    more = pump.idle_power + taken(run.operation.speed["B"])
    shaking = replace(pump, idle_power=more)  # type: ignore[arg-type]
    return Run(_with_pump(plant, "B", shaking), run.operation)


def thicker_run(
    plant: Plant,
    later: NDArray[np.bool_],
    friction: float,
    slip: float,
    cooled: float,
    faults: Faults,
) -> Run:
    """Run at nominal speed; while `later`, shape (n,), friction losses and slips are multiplied by
    factors, and the liquid is colder by `cooled`, K. Parameters become arrays.

    Source: the factors are independent, as a plant has laminar and turbulent paths.
    """
    rubbed: Any = np.where(later, friction, 1.0)
    slipped: Any = np.where(later, slip, 1.0)
    modules = {}
    for name, module in plant.modules.items():
        pump = module.pump
        if isinstance(pump, Displacement):
            parts = ("slip", "slip_per_speed", "slip_linear", "slip_quadratic")
            pump = replace(pump, **{part: getattr(pump, part) * slipped for part in parts})
        line = replace(module.line, quadratic=module.line.quadratic * rubbed)
        modules[name] = replace(module, pump=pump, line=line)
    mixers = {n: replace(m, quadratic=m.quadratic * rubbed) for n, m in plant.mixers.items()}
    speeds = {name: np.full(later.size, module.speed) for name, module in modules.items()}
    warmth = LIQUID_TEMPERATURE - np.where(later, cooled, 0.0)
    time = np.arange(later.size, dtype=np.float64)
    operation = Operation(time, speeds, temperature=dict.fromkeys(modules, warmth))
    return Run(replace(plant, modules=modules, mixers=mixers), operation, faults)


def _tour(plant: Plant) -> Run:
    return settling(visiting_run(plant, operating_points(plant, POINTS), {}, hold=STAY))


def _with_pump(plant: Plant, module: str, pump: Displacement) -> Plant:
    changed = replace(plant.modules[module], pump=pump)
    return replace(plant, modules={**plant.modules, module: changed})
