"""Waste-water station against the maker's curves: every second day is shown to the tool.

The calculated inflow is no column of the plant. What is judged is the flow of each pump, simulated
from its frequency and the level, in samples in which it runs for longer than the mean of 15 min.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from tests.rig.mismatch.ask import Answer, adopt, simulate
from tests.rig.mismatch.case import Case, Row, copy_plant, copy_rows
from tests.rig.mismatch.measure import Array, numbers, rms, robust
from tests.rig.station import FILE, LARGE, PUMPS

LOWEST = 1.2
RUNNING, MAKERS_FIRST = 45.0, {True: 1840.0, False: 1080.0}
"""Hz; smallest flow on the maker's curves (large, small), m3/h."""

BY_HAND = (
    "m3/h, unseen days: shipped 332, head factor per pump (recalibration) 234, and inlet or "
    "tunnel loss with the square of the total flow 205; own offset per run 124, and slope 64; "
    "noise 3 to 6. Missing head and power excess rise and fall together, run by run, up to 7 m: "
    "rags or recirculation (a fault with periods), not missing physics"
)


def odd_day(row: Row) -> bool:
    """Days of November that are shown to the tool."""
    return int(row["time"][8:10]) % 2 == 1


def prepare(folder: Path, work: Path) -> list[Case]:
    """Plant and recordings."""
    plant = copy_plant("hsy-pumping", work)
    shown, unseen = work / "hsy-shown.csv", work / "hsy-unseen.csv"
    copy_rows(folder / FILE, shown, odd_day)
    copy_rows(folder / FILE, unseen, lambda row: not odd_day(row))
    return [Case("hsy", plant, shown, unseen, BY_HAND)]


def flow_errors(plant: Path, unseen: Path, target: Path) -> dict[str, Array]:
    """Simulated less measured flow of each pump in steady samples, m3/h."""
    simulate(plant, unseen, target)
    level, errors = numbers(unseen, "L1_m"), {}
    with target.open(encoding="utf-8") as file:
        known = set(next(csv.reader(file)))
    for pump in PUMPS:
        title = f"Q{pump[1:]}_m3ph"
        measured, running = numbers(unseen, title), numbers(unseen, f"f{pump[1:]}_Hz") > RUNNING
        steady = running & np.roll(running, 1) & np.roll(running, -1)
        steady &= (level >= LOWEST) & (measured >= MAKERS_FIRST[pump in LARGE])
        if steady.any() and title in known:
            errors[pump] = (numbers(target, title) - measured)[steady]
    return errors


def repair_lines(case: Case, answer: Answer, work: Path) -> list[str]:
    """Adopt, and compare the flows of shipped and repaired plant on the unseen days."""
    before = flow_errors(case.plant, case.unseen, work / "hsy-shipped.csv")
    after = flow_errors(adopt(answer), case.unseen, work / "hsy-repaired.csv")
    lines = [
        f"{pump}: {rms(before[pump]):.0f} -> {rms(after[pump]):.0f} m3/h, robust "
        f"{robust(before[pump]):.0f} -> {robust(after[pump]):.0f} ({len(after[pump])} samples)"
        for pump in after
    ]
    whole = [rms(np.concatenate(list(part.values()))) for part in (before, after)]
    return [*lines, f"all: {whole[0]:.0f} -> {whole[1]:.0f} m3/h"]
