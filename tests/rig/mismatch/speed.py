"""How long an analysis takes: 100,000 samples of seven modules."""

from __future__ import annotations

import csv
from pathlib import Path

from tests.rig.mismatch.ask import call
from tests.rig.mismatch.case import Case, copy_plant

PLANT = "mixing-rig"
INPUTS = Path("examples") / "calibration.csv"
SAMPLES = 100_000
SEED = 1


def long_inputs(source: Path, target: Path, samples: int) -> None:
    """Repeat a recording until it has as many rows, one second apart."""
    with source.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    time = header.index("time [s]")
    with target.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out)
        writer.writerow(header)
        for number in range(samples):
            row = list(rows[number % len(rows)])
            row[time] = str(number)
            writer.writerow(row)


def prepare(work: Path, samples: int = SAMPLES) -> Case:
    """The rig, simulated with noise over a long recording."""
    plant = copy_plant(PLANT, work)
    inputs, recording = work / "long-inputs.csv", work / "long.csv"
    long_inputs(plant.parent / INPUTS, inputs, samples)
    call("simulate", plant, inputs, "-o", recording, "--noise", SEED)
    return Case(f"{samples} samples, seven modules", plant, recording, recording)
