"""Command: make the recordings that ship with a plant.

`python -m tests.dosing examples --plant abc -o DIR`
"""

from argparse import ArgumentParser
from collections.abc import Mapping
from pathlib import Path

from rulec.prove.truth.recording import write_csv
from rulec.prove.truth.sensors import TABLE_1
from tests.dosing.plant import Plant
from tests.dosing.recording import record
from tests.dosing.rigs import RIGS
from tests.dosing.runs import (
    Run,
    calibration_run,
    fault_replay,
    healthy_run,
    operating_points,
    settling,
    shaken_run,
    visiting_run,
    warm_run,
)

EXAMPLE_SEED = 1
BENCH_SEED = 2  # a maker's bench has other sensors, hence other systematic errors
EXAMPLES = ("abc", "mixing-rig")  # plants that ship with recordings
SWAPPED = ("B.dp [bar]", "C.dp [bar]")  # columns that are exchanged in swapped.csv


def main(arguments: list[str] | None = None) -> None:
    """Write the examples of a plant; of those with faults the truth as well."""
    parser = ArgumentParser(prog="python -m tests.dosing", description=__doc__)
    parser.add_argument("command", choices=("examples",))
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--plant", choices=EXAMPLES, default="abc")
    options = parser.parse_args(arguments)
    folder: Path = options.out
    folder.mkdir(parents=True, exist_ok=True)
    for name, run in _examples(options.plant, RIGS[options.plant]).items():
        recording = record(run, TABLE_1, BENCH_SEED if name == "calibration" else EXAMPLE_SEED)
        write_csv(folder / f"{name}.csv", recording.readings)
        if run.faults:
            write_csv(folder / f"{name}.truth.csv", recording.truth)
        if name == "healthy":
            one, other = (recording.readings[column] for column in SWAPPED)
            exchanged = dict(zip(SWAPPED, (other, one), strict=True))
            write_csv(folder / "swapped.csv", {**recording.readings, **exchanged})


def _examples(name: str, plant: Plant) -> Mapping[str, Run]:
    runs = {"calibration": calibration_run(plant)}
    if name == "abc":
        runs |= {"leakage_A": fault_replay(plant, "A.leakage"), "healthy": healthy_run(plant)}
        return {**runs, "warm_A": warm_run(plant), "shaking_B": shaken_run(plant)}
    tour = visiting_run(plant, operating_points(plant, 5), {"D.clogging": 0.3}, lead_in=15)
    return {**runs, "clogging_D": settling(tour)}


if __name__ == "__main__":
    main()
