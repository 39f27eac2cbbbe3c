"""Command: make the recordings that ship with a plant.

`python -m rulec.prove.truth examples --plant abc -o DIR`
"""

from argparse import ArgumentParser
from pathlib import Path

from .recording import record, write_csv
from .rigs import RIGS
from .runs import (
    Run,
    calibration_run,
    healthy_run,
    leakage_replay,
    operating_points,
    settling,
    shaken_run,
    visiting_run,
    warm_run,
)
from .sensors import TABLE_1

EXAMPLE_SEED = 1
BENCH_SEED = 2  # a maker's bench has other sensors, hence other systematic errors
EXAMPLES = ("abc", "mixing-rig")  # plants that ship with recordings


def main(arguments: list[str] | None = None) -> None:
    """Write the examples of a plant."""
    parser = ArgumentParser(prog="python -m rulec.prove.truth", description=__doc__)
    parser.add_argument("command", choices=("examples",))
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--plant", choices=EXAMPLES, default="abc")
    options = parser.parse_args(arguments)
    plant, folder = RIGS[options.plant](), options.out
    _write(folder, "calibration", calibration_run(plant), BENCH_SEED)
    if options.plant == "abc":
        _write(folder, "leakage_A", leakage_replay(plant), EXAMPLE_SEED, with_truth=True)
        _write(folder, "healthy", healthy_run(plant), EXAMPLE_SEED)
        _write(folder, "warm_A", warm_run(plant), EXAMPLE_SEED)
        _write_swapped(folder / "healthy.csv", folder / "swapped.csv", "B.dp [bar]", "C.dp [bar]")
        _write(folder, "shaking_B", shaken_run(plant), EXAMPLE_SEED)
    else:
        tour = visiting_run(plant, operating_points(plant, 5), {"D.clogging": 0.3}, lead_in=15)
        _write(folder, "clogging_D", settling(tour), EXAMPLE_SEED, with_truth=True)


def _write(folder: Path, name: str, run: Run, seed: int, with_truth: bool = False) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    recording = record(run, TABLE_1, seed)
    write_csv(folder / f"{name}.csv", recording.readings)
    if with_truth:
        write_csv(folder / f"{name}.truth.csv", recording.truth)


def _write_swapped(source: Path, target: Path, one: str, other: str) -> None:
    """Write a recording with the cells of two columns exchanged."""
    head, *rows = source.read_text(encoding="utf-8").splitlines()
    i, j = (head.split(",").index(name) for name in (one, other))
    lines = [head]
    for row in rows:
        cells = row.split(",")
        cells[i], cells[j] = cells[j], cells[i]
        lines.append(",".join(cells))
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
