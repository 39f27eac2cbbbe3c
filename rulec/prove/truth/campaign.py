"""Campaigns: lists of cases over faults, degrees and operating points, with fixed seeds."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from .plant import Plant
from .runs import HOLD, Run, Speeds, visiting_run
from .transients import settling


@dataclass(frozen=True)
class Case:
    """One recording to be made.

    Attributes
    ----------
    faults : set degree by fault, all present at once; empty for a healthy case
    run : operation of the plant
    seed : of the sensors' errors
    """

    faults: Mapping[str, float]
    run: Run
    seed: int


def campaign(
    plant: Plant,
    fault_sets: Iterable[Mapping[str, float]],
    visits: Sequence[Sequence[Speeds]],
    first_seed: int,
    lead_in: int = HOLD,
    hold: int = HOLD,
) -> list[Case]:
    """Combine each set of faults with each visit to operating points; seeds count up."""
    every = product(fault_sets, visits)
    return [
        Case(faults, settling(visiting_run(plant, points, faults, lead_in, hold)), first_seed + k)
        for k, (faults, points) in enumerate(every)
    ]


def published_faults(plant: Plant) -> list[str]:
    """Return the paper's faults: 7 per dosing module, 4 per mixer (method.md, section 4).

    The paper has no fault of the speed sensor.
    """
    names = []
    for module in plant.modules:
        names += [f"{module}.{kind}" for kind in ("leakage", "clogging", "widening")]
        names += [f"{module}.{s}.{kind}" for s in ("dp", "P_el") for kind in ("high", "low")]
    for mixer in plant.mixers:
        names += [f"{mixer}.{kind}" for kind in ("clogging", "widening", "dp.high", "dp.low")]
    return names


def single_faults(plant: Plant, degrees: Sequence[float]) -> list[dict[str, float]]:
    """Return every published fault alone, with each degree."""
    return [{name: degree} for name in published_faults(plant) for degree in degrees]


def fault_pairs(plant: Plant) -> list[dict[str, float]]:
    """Return all pairs of published faults at different places, with drawn degrees.

    The place of a fault is its sensor, or the line it narrows: a line that is both clogged and
    widened has one friction, and a sensor one slope.
    """
    faults = combinations(published_faults(plant), 2)
    pairs = [pair for pair in faults if _place(pair[0]) != _place(pair[1])]
    degrees = np.random.default_rng(1).uniform(0.2, 0.4, (len(pairs), 2)).tolist()
    return [dict(zip(pair, drawn, strict=True)) for pair, drawn in zip(pairs, degrees, strict=True)]


def _place(fault: str) -> str:
    """`A.dp` of `A.dp.high`, `A.friction` of `A.clogging`, `A.leakage` of itself."""
    place, _, kind = fault.rpartition(".")
    if kind in ("clogging", "widening"):
        return f"{place}.friction"
    return fault if kind == "leakage" else place
