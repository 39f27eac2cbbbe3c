"""Campaigns: lists of cases over faults, degrees and operating points, with fixed seeds."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from tests.dosing.faults import possible_faults
from tests.dosing.plant import Plant
from tests.dosing.runs import DWELL, Run, Speeds, settling, visiting_run

PUBLISHED = ("leakage", "clogging", "widening", "dp", "P_el")


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


def single_faults(plant: Plant, degrees: Sequence[float]) -> list[dict[str, float]]:
    """Return every fault of the paper alone, with each degree: none of sensors but of pressures and
    powers."""
    ours = [n for n in possible_faults(plant) if n.split(".")[1] in PUBLISHED]
    return [{name: degree} for name in ours for degree in degrees]
