"""What a plant-day of a fleet costs, and whether a killed worker changes anything.

``python -m tests.rig.fleet --json -`` simulates plants for a day at 1 Hz (each with its own
parameters and errors, set points that change every half hour, a fault from noon on in every tenth),
judges them in two processes of this machine, then again on a cluster of dask with two workers, of
which one is killed on the way.
"""

import argparse
import json
import os
import resource
import signal
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.fleet.plant_day import Row, Task

from rulec.commands.arguments import ruleset_of
from rulec.engines.call import DASK, Engine
from rulec.fleet.fleet_file import Fleet, read_fleet
from rulec.fleet.plant_days import judged, tasks_of
from rulec.fleet.store import Store, tables
from rulec.passes.perturb import true_plan
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation
from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate_with
from tests.conftest import ROOT

JOBS, STEP, EVERY, DEGREE = 2, 1800, 10, 0.2


def write_day(models: Compilation, folder: Path, number: int, seconds: int) -> str:
    """A day of one plant as Parquet; gives its fault, empty where it has none.

    Each plant is its own: parameters are drawn from their covariance, laws are off by their misfit,
    sensors by their uncertainty. A set point is solved once, and each second has noise of its own.
    """
    import pyarrow
    import pyarrow.parquet

    rules, random = models.ruleset, np.random.default_rng(number)
    faults = [f.id for f in rules.faults]
    truth = true_plan(models, faults, random)
    equations, steps = equations_of(replace(rules, undo=truth)), -(-seconds // STEP)
    given = {}
    for own in equations.given_signals:
        share = random.uniform(0.85, 1.1, steps)
        given[own.id] = own.offset + (own.reference - own.offset) * share
    off = {o.id: o.misfit * random.standard_normal(steps) for o in rules.observers}
    fault, degrees = "", {}
    if number % EVERY == 0:
        possible = [f.id for f in rules.faults if not f.in_sensor and not f.unit]
        fault = possible[number // EVERY % len(possible)]
        degrees[fault] = np.where(np.arange(steps) >= steps // 2, DEGREE, 0.0)
    simulated = simulate_with(equations, given, degrees, off)
    true = {n: np.repeat(v, STEP)[:seconds] for n, v in simulated.values.items()}
    values = sense(rules, true, SensorErrors(bounded=True), random)
    start = np.datetime64("2026-01-01", "ms")
    columns: dict[str, Any] = {"time": start + (1000 * np.arange(seconds)).astype("m8[ms]")}
    for name, own in rules.signal_by_id.items():
        if name in rules.observed:
            shown = (values[name] - own.offset) / own.factor
            columns[f"{name} [{own.unit}]"] = np.round(shown, 4)
    partition = folder / f"plant=P{number:04d}" / "day=2026-01-01"
    partition.mkdir(parents=True)
    pyarrow.parquet.write_table(pyarrow.table(columns), partition / "day.parquet")
    return fault


def cpu() -> float:
    """CPU seconds of this process and of its children that have ended."""
    used = [resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def collected(fleet: Fleet, results: Iterator[tuple[Task, Row]]) -> dict[Task, Row]:
    store, found = Store(fleet), {}
    for task, row in results:
        store.keep(task, row)
        found[task] = row
    tables(store, [*found], lambda _: None)
    return found


def on_a_cluster(fleet: Fleet, tasks: list[Task]) -> dict[Task, Row]:
    """Judged by two workers, of which one is killed behind the first result."""
    import distributed

    with distributed.LocalCluster(
        n_workers=JOBS, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        victim, found = next(iter(cluster.workers.values())).pid, {}
        there = Engine(kind=DASK, scheduler=cluster.scheduler_address)
        for task, row in judged(there, tasks, fleet.rulesets):
            if not found:
                os.kill(victim, signal.SIGKILL)
            found[task] = row
        return found


def measured(folder: Path, plants: int, seconds: int) -> dict[str, Any]:
    models = run_passes(Compilation(path=ROOT / "plants" / "abc"))
    (folder / "abc.json").write_text(models.ruleset.to_json(), encoding="utf-8")
    made = [write_day(models, folder / "recordings", number, seconds) for number in range(plants)]
    text = "fleet: rig\nrecordings: recordings\njudged_by: abc.json\ntrace: false\n"
    (folder / "fleet.yaml").write_text(text)
    fleet = read_fleet(folder / "fleet.yaml", ruleset_of)
    tasks = tasks_of(fleet)
    before, begun = cpu(), time.perf_counter()
    found = collected(fleet, judged(Engine(jobs=JOBS), tasks, fleet.rulesets))
    used, lasted = cpu() - before, time.perf_counter() - begun
    # Rows come as they are done; tasks are in the order of the plants.
    named = [{f["fault"] for f in found[task]["findings"]} for task in tasks]
    faulty = [(own, names) for own, names in zip(made, named, strict=True) if own]
    begun = time.perf_counter()
    elsewhere = on_a_cluster(fleet, tasks)
    return {
        "cpu": used / plants,
        "per-minute": 60.0 * plants / used,
        "elapsed": lasted,
        "elapsed-dask": time.perf_counter() - begun,
        "found": sum(own in names for own, names in faulty),
        "alarms": sum(bool(names) for own, names in zip(made, named, strict=True) if not own),
        "same": elsewhere == found,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=1000)
    parser.add_argument("--seconds", type=int, default=86_400)
    parser.add_argument("--json", choices=["-"], help="standard output, as without it")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="rulec-fleet-") as folder:
        print(json.dumps(measured(Path(folder), options.plants, options.seconds), indent=1))


if __name__ == "__main__":
    main()
