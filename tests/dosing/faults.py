"""Faults: a name (`A.leakage`, `C.dp.high`) and a degree over time; several may be present at once.

Definitions of the degree x: leakage, the bypass returns the fraction x of the flow on the pump's
curve at its pressure; clogging and widening, the friction part of the loss is (1 + x) and (1 - x)
times the healthy one at the same flow, the static part unchanged; sensor high and low, the reading
is multiplied by (1 + x) and (1 - x).
Source: Wetterich 2025, Eqs. 4 to 7, read as in method.md, section 1, points 1 and 10.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from rulec.prove.truth.settled.solve import Kind, State, Term
from rulec.prove.truth.units import Array
from tests.dosing.plant import Operation, Plant

Faults = Mapping[str, Array]  # degree, shape (n,), 1


def possible_faults(plant: Plant) -> list[str]:
    """Return the names of all faults of a plant."""
    instances = [*plant.rig.pumps, *plant.rig.mixers]
    names = [f"{name}.leakage" for name in plant.rig.pumps]
    names += [f"{name}.{kind}" for name in instances for kind in ("clogging", "widening")]
    return names + [f"{signal}.{kind}" for signal in plant.rig.sensors for kind in ("high", "low")]


def check_faults(plant: Plant, faults: Faults, samples: int) -> None:
    """Raise ValueError for an unknown fault or a degree outside its range."""
    for name, degree in faults.items():
        if name not in possible_faults(plant):
            raise ValueError(f"no fault '{name}'; known: {', '.join(possible_faults(plant))}")
        limit = np.inf if name.endswith((".clogging", ".high")) else 1.0
        inside = (degree >= 0.0) & (degree < limit)
        if degree.shape != (samples,) or not np.all(inside):
            raise ValueError(f"'{name}' needs {samples} degrees from 0 to below {limit}")


def factor(faults: Faults, location: str, increase: str, decrease: str) -> Array:
    """Return (1 + x) (1 - y) for the degrees of an increasing and a decreasing fault."""
    x, y = (np.asarray(faults.get(f"{location}.{kind}", 0.0)) for kind in (increase, decrease))
    return np.asarray((1.0 + x) * (1.0 - y))


def terms_of(plant: Plant, operation: Operation, faults: Faults) -> Iterator[Term]:
    """Yield the maker's throttles, the lack of mixers on the bench, and the hydraulic faults."""
    rig = plant.rig
    for name in rig.pumps:
        yield _fixed("leak", name, faults.get(f"{name}.leakage", np.zeros(1)))
        yield _fixed("friction", name, factor(faults, name, "clogging", "widening") - 1.0)
        if name in operation.throttle:
            friction = operation.throttle[name] / plant.values[f"{name}.k2"]
            yield _fixed("friction", name, friction)
    for name in rig.mixers:
        left = factor(faults, name, "clogging", "widening") * operation.mixers_fitted
        yield _fixed("friction", name, left - 1.0)


def _fixed(kind: Kind, module: str, value: Array) -> Term:
    """A term that does not depend on the operating point."""

    def law(state: State) -> Array:
        return np.broadcast_to(value, state.flow.shape)

    return Term(kind, module, law)
