"""Physics that the plain laws leave out: slip that follows the liquid's temperature."""

from dataclasses import replace
from typing import Any

import numpy as np

from .plant import LIQUID_TEMPERATURE, Plant
from .pumps import Displacement
from .runs import Run, operating_points, visiting_run
from .transients import settling
from .units import Array

RISE = 0.03
"""Rise of the slip per kelvin: oil loses about 3 % of its viscosity per kelvin [assumed]."""

WARMEST = 30.0
"""Kelvin above the usual temperature."""

STAY = 12
"""Samples at an operating point."""


def warmed(pump: Displacement, temperature: Array) -> Displacement:
    """The pump with liquid of some temperature, K: slip driven by pressure follows 1/viscosity.

    Its slip parameters become arrays, shape (n,).
    """
    factor: Any = np.exp(RISE * (temperature - LIQUID_TEMPERATURE))
    return replace(
        pump,
        slip_linear=pump.slip_linear * factor,
        slip_quadratic=pump.slip_quadratic * factor,
    )


def warm_run(plant: Plant, module: str = "A", points: int = 24) -> Run:
    """Operating points one after the other while a module's liquid warms up and cools down."""
    run = settling(visiting_run(plant, operating_points(plant, points), {}, hold=STAY))
    time = run.operation.time
    temperature = LIQUID_TEMPERATURE + WARMEST * np.sin(np.pi * time / time[-1]) ** 2
    dosing = plant.modules[module]
    assert isinstance(dosing.pump, Displacement)
    warm = replace(dosing, pump=warmed(dosing.pump, temperature))
    return Run(
        replace(plant, modules={**plant.modules, module: warm}),
        replace(run.operation, temperature={module: temperature}),
    )
