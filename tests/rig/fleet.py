"""What a plant-day of a fleet costs, and whether a killed worker changes anything.

``python -m tests.rig.fleet --json -`` simulates plants for a day at 1 Hz (plant abc, set points
that change every half hour, a fault from noon on in every tenth), judges them in two processes of
this machine, then again on a cluster of dask with two workers, of which one is killed on the way.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.fleet.plant_day import Row
from rulec_runtime.fleet.task import Task

from rulec.api.given import ruleset_of
from rulec.fleet import dask_engine, local
from rulec.fleet.fleet_file import read_fleet
from rulec.fleet.places import tasks_of
from rulec.fleet.plan import Fleet
from rulec.fleet.store import DONE, Store, tables
from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate_with
from tests.conftest import compiled

JOBS, HELD, EVERY, DEGREE = 2, 1800, 10, 0.2


def write_day(rules: Ruleset, folder: Path, number: int, seconds: int) -> None:
    """A day of one plant as Parquet."""
    import pyarrow
    import pyarrow.parquet

    random, equations = np.random.default_rng(number), equations_of(rules)
    given = {}
    for own in equations.given_signals:
        share = random.uniform(0.85, 1.1, -(-seconds // HELD))
        levels = own.offset + (own.reference - own.offset) * share
        given[own.id] = np.repeat(levels, HELD)[:seconds]
    degrees = {}
    if number % EVERY == 0:
        faults = [f.id for f in rules.faults if not f.in_sensor and not f.unit]
        course = np.zeros(seconds)
        course[seconds // 2 :] = DEGREE
        degrees[faults[number // EVERY % len(faults)]] = course
    simulated = simulate_with(equations, given, degrees)
    values = sense(rules, simulated.values, SensorErrors(bounded=True), random)
    start = np.datetime64("2026-01-01", "ms")
    columns: dict[str, Any] = {"time": start + (1000 * np.arange(seconds)).astype("m8[ms]")}
    for name, own in rules.signal_by_id.items():
        if name in rules.observed:
            shown = (values[name] - own.offset) / own.factor
            columns[f"{name} [{own.unit}]"] = np.round(shown, 4)
    place = folder / f"plant=P{number:04d}" / "day=2026-01-01"
    place.mkdir(parents=True)
    pyarrow.parquet.write_table(pyarrow.table(columns), place / "day.parquet")


def cpu() -> float:
    """CPU seconds of this process and of its children that have ended."""
    used = [resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def size_of(folder: Path) -> int:
    return sum(f.stat().st_size for f in folder.rglob("*") if f.is_file())


def judged(fleet: Fleet, results: Iterator[tuple[Task, Row]]) -> dict[Task, Row]:
    """All rows, kept as the command keeps them."""
    store, found = Store(fleet.results, fleet.plant_key, fleet.day_key), {}
    for task, row in results:
        store.keep(task, row)
        found[task] = row
    tables(store, [*found], lambda _: None)
    return found


def with_kill(results: Iterator[tuple[Task, Row]], kill: Callable[[], None]) -> Iterator[Any]:
    """The same, where a worker is killed behind the first result."""
    for number, one in enumerate(results):
        if not number:
            kill()
        yield one


def on_a_cluster(fleet: Fleet, tasks: list[Task]) -> dict[Task, Row]:
    """Judged by two workers, of which one is killed."""
    import distributed

    with distributed.LocalCluster(
        n_workers=JOBS, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        victim = next(iter(cluster.workers.values())).pid
        run = dask_engine.run(tasks, fleet.rulesets, JOBS, cluster.scheduler_address)
        return dict(with_kill(run, lambda: os.kill(victim, signal.SIGKILL)))


def measured(folder: Path, plants: int, seconds: int, trace: bool) -> dict[str, Any]:
    rules = compiled("abc")
    (folder / "abc.json").write_text(rules.to_json(), encoding="utf-8")
    for number in range(plants):
        write_day(rules, folder / "recordings", number, seconds)
    text = f"fleet: rig\nrecordings: recordings\njudged_by: abc.json\ntrace: {str(trace).lower()}\n"
    (folder / "fleet.yaml").write_text(text)
    fleet = read_fleet(folder / "fleet.yaml", ruleset_of)
    tasks = tasks_of(fleet)
    before, begun = cpu(), time.perf_counter()
    found = judged(fleet, local.run(tasks, fleet.rulesets, JOBS))
    used, lasted = cpu() - before, time.perf_counter() - begun
    rows = [*found.values()]
    return {
        "plants": plants,
        "seconds": seconds,
        "cpu": used / plants,
        "per-minute": 60.0 * plants / used,
        "elapsed": lasted,
        "recordings": size_of(folder / "recordings") / plants,
        "results": size_of(fleet.results / DONE) / plants,
        "faulty": sum(row["plant"][1:].isdigit() and bool(row["findings"]) for row in rows),
        "same": on_a_cluster(fleet, tasks) == found,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=50)
    parser.add_argument("--seconds", type=int, default=86_400)
    parser.add_argument("--trace", action="store_true")
    parser.add_argument("--json", default="-")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="rulec-fleet-") as folder:
        told = measured(Path(folder), options.plants, options.seconds, options.trace)
    text = json.dumps(told, indent=1)
    print(text) if options.json == "-" else Path(options.json).write_text(text + "\n")


if __name__ == "__main__":
    main()
