"""The cheapest sensors that isolate faults from each other.

What a sensor adds is one more comparison; its effects and covariance follow from the tables of
`linearise`, so nothing is compiled again.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.limits import LEAST_SPREAD, MOST_SENSORS, SEEN, SEPARATED, SMALL_DEGREE
from rulec.passes.neighbourhood import Neighbourhood, Sensor, apart


@dataclass(frozen=True)
class Advice:
    """Sensors that together tell a group apart, and the degree from which on they do."""

    sensors: tuple[Sensor, ...]
    degree: float


def degrees_of(gram: Array) -> tuple[float, ...]:
    """Per fault the degree, as a share, from which on it is isolated from every other one.

    `gram` holds products of effects, shape (faults, faults); inf where no degree isolates a fault.
    """
    distance = apart(gram)
    with np.errstate(divide="ignore"):
        worst = SEPARATED / distance.min(axis=-1)
    return tuple(float(x) for x in worst)


def cheapest(
    hood: Neighbourhood, faults: Sequence[str], sensors: Sequence[Sensor]
) -> Advice | None:
    """The cheapest one or two sensors that isolate all faults, else a greedy choice of more."""
    gram = hood.gram(faults)
    effects, covariance = hood.added(faults, sensors)

    def among(chosen: tuple[int, ...]) -> Array:
        """Products of effects with some of the sensors added."""
        part = effects[:, chosen]
        own = covariance[np.ix_(chosen, chosen)]
        inverse = np.linalg.inv(own + LEAST_SPREAD * np.eye(len(chosen)))
        more: Array = gram + part @ inverse @ part.T
        return more

    def cost(chosen: tuple[int, ...]) -> float:
        return sum(sensors[i].cost for i in chosen)

    numbers = range(len(sensors))
    choices = [c for k in (1, 2) for c in itertools.combinations(numbers, k)]
    for _, same in itertools.groupby(sorted(choices, key=cost), key=cost):
        told = [(max(degrees_of(among(c))), c) for c in same if _is_isolated(among(c))]
        if told:
            degree, chosen = min(told)
            return Advice(tuple(sensors[i] for i in chosen), degree)
    chosen = ()
    while len(chosen) < min(MOST_SENSORS, len(sensors)):
        more = [(*chosen, i) for i in numbers if i not in chosen]
        chosen = min(more, key=lambda c: (_degrees_left(among(c)), cost(c)))
        if _is_isolated(among(chosen)):
            return Advice(tuple(sensors[i] for i in chosen), max(degrees_of(among(chosen))))
    return None


def _degrees_left(gram: Array) -> tuple[int, float]:
    """Number of faults that no degree isolates, and the largest degree of the others."""
    degrees = np.array(degrees_of(gram))
    never = np.isinf(degrees)
    return int(never.sum()), float(degrees[~never].max(initial=0.0))


def _is_isolated(gram: Array) -> bool:
    """Is every fault isolated at a small degree, or nearly as soon as it is detected?"""
    distance = apart(gram)
    enough = np.minimum(SMALL_DEGREE * np.diagonal(distance) / SEEN, SEPARATED)
    return bool(np.all(SMALL_DEGREE * distance.min(axis=-1) >= enough))
