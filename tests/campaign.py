"""Campaigns: lists of cases over faults, degrees and operating points, with fixed seeds."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from tests.dosing.plant import Plant
from tests.dosing.runs import DWELL, Run, Speeds, settling, visiting_run


@dataclass(frozen=True)
class Case:
    """One recording to be made: degrees of faults present at once, operation, sensors' errors."""

    faults: Mapping[str, float]
    run: Run
    seed: int


def campaign(
    plant: Plant,
    fault_sets: Iterable[Mapping[str, float]],
    visits: Sequence[Sequence[Speeds]],
    first_seed: int,
    lead_in: int = DWELL,
    dwell: int = DWELL,
) -> list[Case]:
    """Combine each set of faults with each visit to operating points; seeds count up."""
    every = product(fault_sets, visits)
    return [
        Case(faults, settling(visiting_run(plant, points, faults, lead_in, dwell)), first_seed + k)
        for k, (faults, points) in enumerate(every)
    ]


def published_faults(plant: Plant) -> list[str]:
    """The paper's faults: 7 per dosing module, 4 per mixer, none of the speed sensor."""
    names = []
    for module in plant.rig.pumps:
        names += [f"{module}.{kind}" for kind in ("leakage", "clogging", "widening")]
        names += [f"{module}.{s}.{kind}" for s in ("dp", "P_el") for kind in ("high", "low")]
    for mixer in plant.rig.mixers:
        names += [f"{mixer}.{kind}" for kind in ("clogging", "widening", "dp.high", "dp.low")]
    return names


def single_faults(plant: Plant, degrees: Sequence[float]) -> list[dict[str, float]]:
    """Return every published fault alone, with each degree."""
    return [{name: degree} for name in published_faults(plant) for degree in degrees]
