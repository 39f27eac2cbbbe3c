"""Sensors that could be added to a module, and the cheapest that isolate faults from each other.

A sensor adds one comparison. Its effects and covariance follow from the tables of `linearise`, so
nothing is compiled again.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.module_type import Signal
from rulec.knowledge.plant import Module
from rulec.language.units import VOLUME_FLOW
from rulec.limits import SEPARATED
from rulec.passes.limits import LEAST_SPREAD, MOST_SENSORS, SEEN, SMALL_DEGREE
from rulec.passes.linearise import Linearised
from rulec.passes.neighbourhood import Neighbourhood, Sensor, apart


def candidates(module: Module, knowledge: Knowledge, tables: Linearised) -> Iterable[Sensor]:
    """A second reading of each own signal that an estimate uses, and a flow meter."""
    observers = [f"{module.name}.{o}" for o in module.type.observers]
    inputs = {name for observer in observers for name in tables.gradients[observer]}
    used = [s for s in module.type.signals.values() if f"{module.name}.{s.name}" in inputs]
    for signal in used:
        reading = f"{module.name}.{signal.name}"
        yield Sensor(
            module=module.name,
            signal=signal.name,
            title=f"a second reading of {reading}",
            cost=knowledge.sensors[signal.sensor].cost,
            existing=reading,
            is_estimate=False,
            u=tables.uncertainties[reading],
        )
    if observers and not any(_is_flow(signal) for signal in used):
        yield from _flow_meter(module, knowledge, observers[0], tables.flows[observers[0]])


def _flow_meter(
    module: Module, knowledge: Knowledge, estimate: str, flow: float
) -> Iterable[Sensor]:
    """The cheapest flow meter that the type declares but no estimate uses, else that fits."""
    classes, quantities = knowledge.sensors, knowledge.units.quantities
    declared = [
        (classes[s.sensor], s.name, s.full_scale)
        for s in module.type.signals.values()
        if _is_flow(s)
    ]
    fitting = [
        (c, c.measures, None)
        for c in classes.values()
        if quantities.get(c.measures) == VOLUME_FLOW and c.kind != "full scale"
    ]
    for sensor, name, full_scale in sorted(declared or fitting, key=lambda k: k[0].cost)[:1]:
        yield Sensor(
            module=module.name,
            signal=name,
            title=f"a flow meter in {module.name}",
            cost=sensor.cost,
            existing=estimate,
            is_estimate=True,
            u=sensor.uncertainty(full_scale, flow),
        )


def _is_flow(signal: Signal) -> bool:
    return signal.unit.dimension == VOLUME_FLOW


@dataclass(frozen=True)
class Advice:
    """Sensors that together isolate the faults of a group, and the smallest degree they need."""

    sensors: tuple[Sensor, ...]
    degree: float


def degrees_at(distance: Array) -> tuple[float, ...]:
    """Per fault the smallest degree, as a share, that isolates it from all others.

    `distance` holds distances per unit of degree, shape (faults, faults), as given by `apart`; inf
    if no degree isolates a fault.
    """
    with np.errstate(divide="ignore"):
        worst = SEPARATED / distance.min(axis=-1)
    return tuple(worst.tolist())


def cheapest(
    hood: Neighbourhood, faults: Sequence[str], sensors: Sequence[Sensor]
) -> Advice | None:
    """The cheapest one or two sensors that isolate all faults, else a greedy choice of more."""
    gram = hood.gram(faults)
    effects, covariance = hood.added(faults, sensors)
    covariance = covariance + LEAST_SPREAD * np.eye(len(sensors))

    def among(chosen: tuple[int, ...]) -> Array:
        """Distances of the faults with some of the sensors added, as given by `apart`."""
        part = effects[:, chosen]
        if len(chosen) == 1:
            weighed = part / covariance[chosen[0], chosen[0]]
        else:
            weighed = part @ np.linalg.inv(covariance[np.ix_(chosen, chosen)])
        return apart(gram + weighed @ part.T)

    def cost(chosen: tuple[int, ...]) -> float:
        return sum(sensors[i].cost for i in chosen)

    numbers = range(len(sensors))
    choices = [c for k in (1, 2) for c in itertools.combinations(numbers, k)]
    for _, same in itertools.groupby(sorted(choices, key=cost), key=cost):
        far = ((among(c), c) for c in same)
        isolating = [(max(degrees_at(d)), c) for d, c in far if _is_isolated(d)]
        if isolating:
            degree, chosen = min(isolating)
            return Advice(tuple(sensors[i] for i in chosen), degree)
    chosen = ()
    while len(chosen) < min(MOST_SENSORS, len(sensors)):
        more = [(*chosen, i) for i in numbers if i not in chosen]
        chosen = min(more, key=lambda c: (_degrees_left(among(c)), cost(c)))
        distance = among(chosen)
        if _is_isolated(distance):
            return Advice(tuple(sensors[i] for i in chosen), max(degrees_at(distance)))
    return None


def _degrees_left(distance: Array) -> tuple[int, float]:
    """Number of faults that no degree isolates, and the largest degree of the others."""
    degrees = np.array(degrees_at(distance))
    never = np.isinf(degrees)
    return int(never.sum()), float(degrees[~never].max(initial=0.0))


def _is_isolated(distance: Array) -> bool:
    """Whether each fault is isolated at a small degree, or almost as soon as it is detected."""
    enough = np.minimum(SMALL_DEGREE * np.diagonal(distance) / SEEN, SEPARATED)
    return bool(np.all(SMALL_DEGREE * distance.min(axis=-1) >= enough))
