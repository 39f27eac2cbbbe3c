"""Physics that the plain laws leave out: slip that follows the temperature, a frame that shakes in
a band of speeds."""

from dataclasses import replace

import numpy as np

from .plant import LIQUID_TEMPERATURE, Plant
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


def _tour(plant: Plant) -> Run:
    return settling(visiting_run(plant, operating_points(plant, POINTS), {}, hold=STAY))


def _with_pump(plant: Plant, module: str, pump: Displacement) -> Plant:
    changed = replace(plant.modules[module], pump=pump)
    return replace(plant, modules={**plant.modules, module: changed})
