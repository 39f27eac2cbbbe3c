"""A liquid that gets thicker or thinner on the way: friction and slip of a whole plant at once."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .faults import Faults
from .plant import LIQUID_TEMPERATURE, Operation, Plant
from .pumps import Displacement
from .runs import Run


def changed(
    plant: Plant,
    later: NDArray[np.bool_],
    friction: float,
    slip: float,
    cooled: float,
    faults: Faults,
) -> Run:
    """A run at nominal speed whose friction losses and slips are factors of the sound ones where
    `later`, shape (n,), is true, and whose liquid is then colder, K. Parameters become arrays.

    Source: the factors are independent of one another, as a plant mixes laminar and turbulent ways.
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
