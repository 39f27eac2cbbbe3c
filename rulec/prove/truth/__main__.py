"""Command: make recordings with a known truth, `python -m rulec.prove.truth leakage -o DIR`."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from .recording import record, write_csv
from .rigs import RIGS
from .runs import (
    DEGREES,
    Run,
    calibration_run,
    fault_replay,
    healthy_run,
    leakage_replay,
    operating_points,
    visiting_run,
)
from .sensors import NOISE_FREE, TABLE_1, Sensing
from .shaking import shaken_run
from .transients import settling
from .warming import warm_run

EXAMPLE_SEED = 1
BENCH_SEED = 2  # a maker's bench has other sensors, hence other systematic errors
EXAMPLES = ("abc", "mixing-rig")  # plants that ship with recordings


def main(arguments: list[str] | None = None) -> None:
    """Run one subcommand."""
    parser = _parser()
    options = parser.parse_args(arguments)
    try:
        match options.command:
            case "points":
                _print_points()
            case "examples":
                _write_examples(options.plant, options.out)
            case _:
                _write_run(options)
    except ValueError as problem:
        parser.error(str(problem))


def _parser() -> ArgumentParser:
    """Options of all subcommands."""
    parser = ArgumentParser(prog="python -m rulec.prove.truth", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("points", help="print the fault-free operating point of every plant")
    examples = commands.add_parser(
        "examples",
        help=f"write the examples of a plant (seed {EXAMPLE_SEED}; calibration {BENCH_SEED})",
    )
    examples.add_argument("-o", "--out", type=Path, required=True, metavar="DIR")
    examples.add_argument("--plant", choices=EXAMPLES, default="abc")
    healthy = commands.add_parser("healthy", help="fault-free at nominal speed")
    healthy.add_argument("--samples", type=int, default=60)
    leakage = commands.add_parser("leakage", help="leakage in plateaus of 10 s")
    leakage.add_argument("--module", default="A")
    fault = commands.add_parser("fault", help="any fault in plateaus of 10 s")
    fault.add_argument("fault", help="such as C.clogging or A.dp.high")
    fault.add_argument("--degrees", type=float, nargs="+", default=list(DEGREES))
    calibration = commands.add_parser("calibration", help="a maker's calibration")
    for command in (healthy, leakage, fault, calibration):
        command.add_argument("-o", "--out", type=Path, required=True, metavar="DIR")
        command.add_argument("--plant", choices=sorted(RIGS), default="abc")
        command.add_argument("--seed", type=int, default=1)
        command.add_argument("--noise-free", action="store_true")
        command.add_argument("--quantised", action="store_true")
        command.add_argument("--digits", type=int, help="default 6, noise-free 12")
    return parser


def _write_run(options: Namespace) -> None:
    """Write recording and truth of the chosen run."""
    plant = RIGS[options.plant]()
    match options.command:
        case "healthy":
            name, run = "healthy", healthy_run(plant, options.samples)
        case "leakage":
            name, run = f"leakage_{options.module}", leakage_replay(plant, options.module)
        case "fault":
            name, run = options.fault, fault_replay(plant, options.fault, options.degrees)
        case _:
            name, run = "calibration", calibration_run(plant)
    noise = NOISE_FREE if options.noise_free else TABLE_1
    sensing = Sensing(noise.systematic, noise.statistical, options.quantised)
    digits = options.digits or (12 if options.noise_free else 6)
    _write(options.out, name, run, sensing, options.seed, digits)


def _write(
    folder: Path,
    name: str,
    run: Run,
    sensing: Sensing,
    seed: int,
    digits: int = 6,
    with_truth: bool = True,
) -> None:
    """Write `name.csv` and `name.truth.csv`."""
    folder.mkdir(parents=True, exist_ok=True)
    recording = record(run, sensing, seed)
    write_csv(folder / f"{name}.csv", recording.readings, digits)
    if with_truth:
        write_csv(folder / f"{name}.truth.csv", recording.truth, digits)


def _write_examples(name: str, folder: Path) -> None:
    """Write the small recordings that ship with a plant."""
    plant = RIGS[name]()
    _write(folder, "calibration", calibration_run(plant), TABLE_1, BENCH_SEED, with_truth=False)
    if name == "abc":
        _write(folder, "leakage_A", leakage_replay(plant), TABLE_1, EXAMPLE_SEED)
        _write(folder, "healthy", healthy_run(plant), TABLE_1, EXAMPLE_SEED, with_truth=False)
        _write(folder, "warm_A", warm_run(plant), TABLE_1, EXAMPLE_SEED, with_truth=False)
        _write_swapped(folder / "healthy.csv", folder / "swapped.csv", "B.dp [bar]", "C.dp [bar]")
        _write(folder, "shaking_B", shaken_run(plant), TABLE_1, EXAMPLE_SEED, with_truth=False)
    else:
        tour = visiting_run(plant, operating_points(plant, 5), {"D.clogging": 0.3}, lead_in=15)
        _write(folder, "clogging_D", settling(tour), TABLE_1, EXAMPLE_SEED)


def _write_swapped(source: Path, target: Path, one: str, other: str) -> None:
    """A recording in which two columns stand under each other's header."""
    head, *rows = source.read_text(encoding="utf-8").splitlines()
    names = head.split(",")
    order = list(range(len(names)))
    i, j = names.index(one), names.index(other)
    order[i], order[j] = j, i
    lines = [",".join(cells[k] for k in order) for cells in (row.split(",") for row in rows)]
    target.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")


def _print_points() -> None:
    """Print the fault-free readings of every plant at nominal speed, a line per instance."""
    for name, make in RIGS.items():
        columns = record(healthy_run(make(), 1), NOISE_FREE).readings
        print(name)
        for instance in dict.fromkeys(h.partition(".")[0] for h in columns if "." in h):
            shown = {h: v[0] for h, v in columns.items() if h.startswith(f"{instance}.")}
            print("  " + "  ".join(f"{header} {value:.6g}" for header, value in shown.items()))


if __name__ == "__main__":
    main()
