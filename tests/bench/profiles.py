"""The five hottest paths: where their time goes, and what bounds them.

``python -m tests.bench.profiles`` runs each once warm, once for its CPU time, and once more under
cProfile. Beside each stands a *bound*, measured on the same machine: what the least that the path
cannot do without takes. ``--json FILE`` writes what is printed.
"""

from __future__ import annotations

import argparse
import cProfile
import json
import pstats
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from tests.bench.row import median

LISTED = 5
CHAIN, SAMPLES, ROWS = 100, 10_000, 100_000


@dataclass(frozen=True)
class Hot:
    """What is run, and what bounds it: CPU time of the bound, s, and how it is known."""

    key: str
    what: str
    call: Callable[[], object]
    bound: float
    bounded_by: str


@dataclass(frozen=True)
class Profile:
    """CPU time, s, and its bound; share of it in compiled functions (numpy, LAPACK, json, ...);
    names and shares of the functions that take most themselves."""

    key: str
    what: str
    seconds: float
    bound: float
    bounded_by: str
    compiled: float
    hottest: Sequence[tuple[str, float]]


def compiling(folder: Path) -> Hot:
    """A chain of modules; its plan is a graph of shared nodes."""
    from rulec.passes.pipeline import compile_plant
    from tests.bench.rigs import chain

    (folder / "plant.yaml").write_text(chain(CHAIN), encoding="utf-8")
    rules = compile_plant(folder)
    nodes = [*rules.plan.operations, *rules.undo.operations]

    def interned() -> None:
        known: dict[Any, int] = {}
        for name, a, b in nodes:
            known.setdefault((name, a, b), len(known))

    what = f"compile: {CHAIN} modules in a chain"
    text = f"to look each of {len(nodes):,} nodes of its plans up in a table once"
    return Hot("compile", what, lambda: compile_plant(folder), median(interned), text)


def diagnosing(_: Path) -> Hot:
    """A fault that comes and goes with every second stretch."""
    from rulec_runtime.diagnosis.diagnose import diagnose

    from tests.bench.test_plan import in_blocks
    from tests.bench.test_runtime import inputs_of
    from tests.conftest import compiled
    from tests.rig.follower.plants import Planted, recorded

    rules = compiled("abc")
    faults = [f.id for f in rules.faults if not f.in_sensor and f.lowest <= 0.3]
    firsts = range(100, SAMPLES - 26, 26)
    planted = [Planted(faults[k % len(faults)], 0.3, a, a + 13) for k, a in enumerate(firsts)]
    recording = recorded(rules, SAMPLES, planted, 1.0, np.random.default_rng(1))
    plan = rules.plan.select([n for n in rules.plan.outputs if n.startswith(("R:", "u:"))])
    inputs = inputs_of(recording, rules)
    alone = median(lambda: in_blocks(plan, inputs, SAMPLES))
    what = f"diagnose: {SAMPLES:,} samples with {len(planted)} episodes of faults"
    text = "residuals and thresholds of all samples once, by the plan alone"
    return Hot("diagnose", what, lambda: diagnose(recording, rules), alone, text)


def looking(_: Path) -> Hot:
    """A recording with a leakage, which the search names."""
    import rulec
    from tests.conftest import ROOT

    plant = ROOT / "plants" / "abc"
    file = plant / "examples" / "leakage_A.csv"
    matrix = np.random.default_rng(0).standard_normal((400, 120))
    solved = median(lambda: np.linalg.lstsq(matrix, matrix[:, 0], rcond=None))
    text = "one least-squares problem of 400 equations and 120 unknowns; a search has many"
    what = "mismatch: 80 samples of abc"
    return Hot("mismatch", what, lambda: rulec.mismatch(plant, file), solved, text)


def integrating(_: Path) -> Hot:
    """Two tanks, with slopes."""
    from tests.bench.arithmetic import least, measured
    from tests.states.plants import SHIPPED, random_inputs
    from tests.states.test_integrator import SEEDS, run, tanks, values_of

    time_, u = random_inputs(1024)
    values, times = values_of(SHIPPED), 50
    steps = run(time_, u, values, *SEEDS).steps
    bound = times * steps * least(tanks()[1]._tape[0], len(SEEDS), measured())

    def call() -> None:
        for _ in range(times):
            run(time_, u, values, *SEEDS)

    what = f"integrate: two tanks, {times * steps:,} steps with {len(SEEDS)} slopes"
    text = "latency and throughput of this machine's arithmetic"
    return Hot("integrate", what, call, bound, text)


def reading(folder: Path) -> Hot:
    """A CSV file of plant abc."""
    from pyarrow import csv
    from rulec_runtime.recordings.recording import read_recording

    from tests.conftest import compiled
    from tests.rig.long_recording import write

    rules, file = compiled("abc"), folder / "long.csv"
    write(rules, ROWS, file)
    bound = median(lambda: csv.read_csv(file, csv.ReadOptions(use_threads=False)))
    what = f"read: {ROWS:,} rows of CSV, {file.stat().st_size / 1e6:.1f} MB"
    text = "pyarrow, which parses the same numbers in one thread and checks nothing"
    return Hot("read", what, lambda: read_recording(file, rules), bound, text)


PATHS = (compiling, diagnosing, looking, integrating, reading)


def profiled(path: Hot) -> Profile:
    """Warm, then timed, then profiled."""
    path.call()
    begin = time.process_time()
    path.call()
    seconds = time.process_time() - begin
    profile = cProfile.Profile()
    profile.runcall(path.call)
    stats: Mapping[Any, Any] = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    own = {place: numbers[2] for place, numbers in stats.items()}
    total = sum(own.values())
    compiled = sum(t for (file, _, _), t in own.items() if file == "~")
    first = sorted(own, key=lambda place: -own[place])[:LISTED]
    hottest = [(name_of(place), own[place] / total) for place in first]
    return Profile(
        path.key, path.what, seconds, path.bound, path.bounded_by, compiled / total, hottest
    )


def name_of(place: tuple[str, int, str]) -> str:
    """File and function, without the folders of this machine."""
    file, _, function = place
    return function if file == "~" else f"{Path(file).name}: {function}"


def shown(found: Sequence[Profile]) -> Table:
    """One line a path, and its hottest functions."""
    table = Table(box=None, pad_edge=False, padding=(0, 1))
    for title in ("path", "CPU", "bound", "times", "compiled", "bound by", "hottest, own time"):
        table.add_column(title)
    for one in found:
        table.add_row(
            one.what,
            f"{one.seconds:.3g} s",
            f"{one.bound:.2g} s",
            f"{one.seconds / one.bound:.3g}",
            f"{one.compiled:.0%}",
            one.bounded_by,
            "\n".join(f"{share:.0%} {name}" for name, share in one.hottest),
        )
    return table


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.profiles", description=__doc__)
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    found = []
    for prepare in PATHS:
        with tempfile.TemporaryDirectory() as folder:
            found.append(profiled(prepare(Path(folder))))
    console = Console(stderr=options.json == "-")
    console.print(shown(found))
    if options.json:
        form = {p.key: asdict(p) | {"times": p.seconds / p.bound} for p in found}
        text = json.dumps(form, indent=1)
        print(text) if options.json == "-" else Path(options.json).write_text(text + "\n")


if __name__ == "__main__":
    main()
