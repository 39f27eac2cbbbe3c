"""Recordings of plants from which nothing is missing: they must be called clean.

The readings come from `rulec simulate`, which shares the equations of the tool: this counts false
discoveries in noise and sensor errors, not in physics (that is what `rulec prove` is for).
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from tests.rig.mismatch.ask import Answer, Failed, ask, call
from tests.rig.mismatch.case import Case, copy_plant

PLANT = "abc"
INPUTS = Path("examples") / "calibration.csv"


def clean_case(seed: int, plant: Path, work: Path) -> Case:
    """A recording of a plant that is as its files say, with noise of its own."""
    recording = work / f"clean-{seed}.csv"
    call("simulate", plant, plant.parent / INPUTS, "-o", recording, "--noise", seed)
    return Case(f"clean {seed}", plant, recording, recording)


def answers(seeds: int, work: Path, workers: int) -> Iterator[tuple[Case, Answer | str]]:
    """What the tool says of each seed; the processes are the tool's own."""
    plant = copy_plant(PLANT, work)
    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(partial(_asked, plant=plant, work=work), range(seeds))


def _asked(seed: int, plant: Path, work: Path) -> tuple[Case, Answer | str]:
    case = Case(f"clean {seed}", plant, plant, plant)
    try:
        case = clean_case(seed, plant, work)
        return case, ask(case, work)
    except Failed as failure:
        return case, str(failure)
