"""Faults: a name (`A.leakage`, `C.dp.high`) and a degree over time; several may be present at once.

Definitions of the degree x: leakage, the bypass returns the fraction x of the flow on the pump's
curve at its pressure; clogging and widening, the friction part of the loss is (1 + x) and (1 - x)
times the healthy one at the same flow, the static part unchanged; sensor high and low, the reading
is multiplied by (1 + x) and (1 - x).
Source: Wetterich 2025, Eqs. 4 to 7, read as in method.md, section 1, points 1 and 10.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from .network import Condition
from .plant import Operation, Plant
from .sensors import DOSING_SIGNALS, MIXER_SIGNALS
from .units import Array

Faults = Mapping[str, Array]  # degree, shape (n,), 1


def possible_faults(plant: Plant) -> list[str]:
    """Return the names of all faults of a plant."""
    instances = [*plant.modules, *plant.mixers]
    names = [f"{name}.leakage" for name in plant.modules]
    names += [f"{name}.{kind}" for name in instances for kind in ("clogging", "widening")]
    sensors = [f"{name}.{signal}" for name in plant.modules for signal in DOSING_SIGNALS]
    sensors += [f"{name}.{signal}" for name in plant.mixers for signal in MIXER_SIGNALS]
    return names + [f"{place}.{kind}" for place in sensors for kind in ("high", "low")]


def check_faults(plant: Plant, faults: Faults, samples: int) -> None:
    """Raise ValueError for an unknown fault or a degree outside its range."""
    for name, degree in faults.items():
        if name not in possible_faults(plant):
            raise ValueError(f"no fault '{name}'; known: {', '.join(possible_faults(plant))}")
        limit = np.inf if name.endswith((".clogging", ".high")) else 1.0
        inside = (degree >= 0.0) & (degree < limit)
        if degree.shape != (samples,) or not np.all(inside):
            raise ValueError(f"'{name}' needs {samples} degrees from 0 to below {limit}")


def factor(faults: Faults, place: str, increase: str, decrease: str) -> Array:
    """Return (1 + x) (1 - y) for the degrees of an increasing and a decreasing fault."""
    x, y = (np.asarray(faults.get(f"{place}.{kind}", 0.0)) for kind in (increase, decrease))
    return np.asarray((1.0 + x) * (1.0 - y))


def condition_of(plant: Plant, operation: Operation, faults: Faults) -> Condition:
    """Turn operation and hydraulic faults into the state of the plant."""
    samples = operation.time.size

    def columns(values: Iterable[Array | float]) -> Array:
        spread = [np.broadcast_to(value, samples) for value in values]
        return np.stack(spread, 1) if spread else np.empty((samples, 0))

    return Condition(
        speed=columns(operation.speed[name] for name in plant.modules),
        leak=columns(faults.get(f"{name}.leakage", 0.0) for name in plant.modules),
        line_quadratic=columns(
            module.line.quadratic * factor(faults, name, "clogging", "widening")
            + operation.throttle.get(name, 0.0)
            for name, module in plant.modules.items()
        ),
        mixer_quadratic=columns(
            mixer.quadratic * factor(faults, name, "clogging", "widening") * operation.mixers_fitted
            for name, mixer in plant.mixers.items()
        ),
    )
