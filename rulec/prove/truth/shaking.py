"""Physics that no catalogue names: a frame that shakes in a band of speeds, and takes power."""

from dataclasses import replace

import numpy as np

from .plant import Plant
from .pumps import Displacement
from .runs import Run, operating_points, visiting_run
from .transients import settling
from .units import RPM, Array

PEAK, WIDTH = 850.0 * RPM, 60.0 * RPM
"""Speed at which the frame shakes most, and at which it shakes a third of that, from there; rev/s
[assumed]."""

TAKEN = 25.0
"""Power that it takes there, W [assumed]."""

STAY = 12
"""Samples at an operating point."""


def taken(speed: Array) -> Array:
    """Power that shaking takes, W, at speeds, rev/s; shape (n,)."""
    power: Array = TAKEN * np.exp(-(((speed - PEAK) / WIDTH) ** 2))
    return power


def shaken_run(plant: Plant, module: str = "B", points: int = 24) -> Run:
    """Operating points one after the other; the frame below a module shakes."""
    run = settling(visiting_run(plant, operating_points(plant, points), {}, hold=STAY))
    dosing = plant.modules[module]
    assert isinstance(dosing.pump, Displacement)
    more = dosing.pump.idle_power + taken(run.operation.speed[module])
    pump = replace(dosing.pump, idle_power=more)  # type: ignore[arg-type]
    shaking = replace(dosing, pump=pump)
    return Run(replace(plant, modules={**plant.modules, module: shaking}), run.operation)
