"""A study and a proof give the same, to the byte, on this machine and on dask."""

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from rulec_runtime.output.refusal import Misused, Refusal

from rulec.engines.call import DASK, Call, Engine
from rulec.engines.engine import chosen, in_order, run
from rulec.limits import WORKER_DEATHS
from rulec.passes.perturb import true_plan
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation
from rulec.prove.analyst import FORM
from rulec.prove.campaign import Campaign, Workers
from rulec.prove.partition import Partition
from rulec.simulation.equations import equations_of
from rulec.study.campaign import Settings, groups_of, run_groups
from rulec.study.points import operating_points
from tests.conftest import ROOT
from tests.fleet.deadly import ends_if

CASES = Partition("development", 1, quick=True, only="stationary-1-clean--1")
NOTHING = json.dumps({"verdict": "none", "seconds": 1.0})


@pytest.fixture(scope="module")
def elsewhere() -> Iterator[Engine]:
    """A scheduler of dask that is there already, with a worker."""
    import distributed

    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        yield Engine(kind=DASK, scheduler=cluster.scheduler_address)


def test_a_study(elsewhere: Engine) -> None:
    """The same outcomes in the same order."""
    models = run_passes(Compilation(path=ROOT / "plants" / "abc"))
    rules, settings = models.ruleset, Settings(degrees=(0.3,), points=1, seeds=1, healthy=2)
    faults = [f.id for f in rules.faults]
    groups = [*groups_of(rules, settings, lambda random: true_plan(models, faults, random))][:6]
    points, counted = operating_points(equations_of(rules), 1), list[int]()
    here, there = (
        repr(run_groups(rules, points, settings, groups, engine, counted.append))
        for engine in (Engine(), elsewhere)
    )
    assert here == there
    assert 2 * here.count("Outcome(") == sum(counted)


def test_a_proof(elsewhere: Engine, tmp_path: Path) -> None:
    """The same seals, the same files, the same judgement."""
    results = []
    for engine, name in ((Engine(), "local"), (elsewhere, "dask")):
        work = tmp_path / name
        work.mkdir()
        proof = Campaign(CASES, work, Workers(engine, lambda *_: None))
        seals = proof.sealed()
        for folder in (work / "cases").iterdir():
            (folder / FORM).write_text(NOTHING, encoding="utf-8")
        found = proof.judged(seals)
        files = {f.relative_to(work): f.read_bytes() for f in work.rglob("*") if f.is_file()}
        results.append((seals, found, files))
    local, dask = results
    assert local == dask
    assert all(local[0])


def test_what_kills_its_process_ends_a_run() -> None:
    """Without an answer that stands for it, a run cannot go on; no process is left behind. So it is
    with what a call raises."""
    with pytest.raises(Refusal, match=f"{WORKER_DEATHS} processes died at the same work"):
        in_order(Engine(jobs=1), os._exit, [Call((1,))])
    with pytest.raises(ZeroDivisionError):
        list(run(Engine(jobs=1), divmod, [Call((1, 1)), Call((1, 0))]))
    with pytest.raises(Misused, match="--engine spark: give one of local, dask"):
        chosen("spark")


def test_work_beside_what_kills_its_process_is_done() -> None:
    """Calls that were under way in the same processes did not kill them."""
    calls = [Call((number == 1,)) for number in range(4)]
    found = dict(run(Engine(jobs=2), ends_if, calls, died=lambda _: "died"))
    assert found == {0: "done", 1: "died", 2: "done", 3: "done"}
