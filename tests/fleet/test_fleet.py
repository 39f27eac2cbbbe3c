"""A fleet of a few plants, and what the models of many leave out: what is told, whatever is wrong
with a recording, and that nothing is lost, or done twice."""

import json
import multiprocessing
import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest
from rulec_runtime.fleet.plant_day import Row, Task, judge_day

from rulec.cli import main
from rulec.commands import fleet as command
from rulec.commands.arguments import ruleset_of
from rulec.commands.fleet import answer_of, ask_day, summary
from rulec.engines.call import DASK, Engine
from rulec.fleet import plant_days as fleet_judged
from rulec.fleet.fleet_file import Fleet, read_fleet
from rulec.fleet.plant_days import judged, tasks_of
from rulec.fleet.ranking import ranked, verdict
from rulec.language.diagnostics import Refused
from rulec.limits import WORKER_DEATHS
from tests.conftest import ROOT, Capsys, Patch, compiled
from tests.fleet import deadly

ABC = ROOT / "plants/abc"

FEW = "fleet/recordings/plant=east/day=2026-01-01/few.csv"

RECORDED = {
    ("P1", "2026-01-01"): "healthy.csv",
    ("P1", "2026-01-02"): "leakage_A.csv",
    ("P2", "2026-01-01"): "leakage_A.parquet",
    ("P2", "2026-01-02"): "healthy.csv",
    ("P 3", "2026-01-01"): "healthy.csv",
    ("P4", "2026-01-01"): FEW,
    ("P4", "2026-01-02"): "",
}


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fleet with good plant-days, one without columns that are needed, and a broken file."""
    folder = tmp_path_factory.mktemp("fleet")
    for (plant, day), name in RECORDED.items():
        partition = folder / f"recordings/plant={plant.replace(' ', '%20')}/day={day}"
        partition.mkdir(parents=True)
        if name:
            shutil.copy(ABC / "examples" / name, partition)
        else:
            (partition / "broken.parquet").write_bytes(b"PAR1 and no more")
    text = f"fleet: few\nrecordings: recordings\njudged_by: {ABC}\ntrace: true\n"
    (folder / "fleet.yaml").write_text(text)
    (folder / "abc.json").write_text(compiled("abc").to_json(), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def fleet(home: Path) -> Fleet:
    return read_fleet(home / "fleet.yaml", ruleset_of)


@pytest.fixture(scope="module")
def here(fleet: Fleet) -> dict[Task, Row]:
    """Judged in this process."""
    return {task: judge_day(task, fleet.rulesets[task.ruleset]) for task in tasks_of(fleet)}


def test_every_plant_day_has_a_row(here: dict[Task, Row]) -> None:
    """What cannot be judged says why, and stops nobody else."""
    rows = {(row["plant"], row["day"]): row for row in here.values()}
    assert RECORDED.keys() == rows.keys()
    leak = rows["P2", "2026-01-01"]
    assert {"A.leakage"} == {f["fault"] for f in leak["findings"]}
    assert leak["status"] == "M"
    assert 0.0 < leak["health"] < 1.0
    assert {"ok", "A.leakage"} <= {run["verdict"] for run in leak["trace"]}
    assert sum(run["samples"] for run in leak["trace"]) == leak["samples"]
    assert (1.0, "ok") == (rows["P1", "2026-01-01"]["health"], rows["P1", "2026-01-01"]["status"])
    assert " not recorded" in rows["P4", "2026-01-01"]["reason"]
    assert rows["P4", "2026-01-01"]["health"] is None
    assert rows["P4", "2026-01-02"]["status"] == "unread"
    assert "broken.parquet" in rows["P4", "2026-01-02"]["reason"]


def killed_once(results: Iterator[tuple[Task, Row]], kill: Any) -> dict[Task, Row]:
    """All results, where a worker is killed behind the first of them."""
    found: dict[Task, Row] = {}
    for task, row in results:
        if not found:
            kill()
        assert task not in found
        found[task] = row
    return found


def test_a_killed_process_changes_nothing(fleet: Fleet, here: dict[Task, Row]) -> None:
    def kill() -> None:
        os.kill(multiprocessing.active_children()[0].pid or 0, signal.SIGKILL)

    assert here == killed_once(judged(Engine(jobs=2), tasks_of(fleet), fleet.rulesets), kill)


def test_a_killed_worker_of_a_cluster_changes_nothing(fleet: Fleet, here: dict[Task, Row]) -> None:
    """A real scheduler that is there already, and two workers."""
    import distributed

    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        victim = next(iter(cluster.workers.values())).pid

        def kill() -> None:
            os.kill(victim, signal.SIGKILL)

        there = Engine(kind=DASK, scheduler=cluster.scheduler_address)
        found = killed_once(judged(there, tasks_of(fleet), fleet.rulesets), kill)
    assert here == found


def test_a_plant_day_that_kills_its_process_is_given_up(fleet: Fleet, monkeypatch: Patch) -> None:
    monkeypatch.setattr(fleet_judged, "judge_day", deadly.ends)
    (task, *_), rulesets = tasks_of(fleet), fleet.rulesets
    ((_, row),) = judged(Engine(), [task], rulesets)
    assert row["status"] == "unread"
    assert f"{WORKER_DEATHS} processes died" in row["reason"]


def test_what_is_done_is_not_done_again(
    home: Path,
    here: dict[Task, Row],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A run that ends on the way goes on where it was, and the same work gives the same bytes."""
    before = {task.key: row for task, row in here.items()}
    done: list[Task] = []

    def run(_: object, tasks: list[Task], *more: object) -> Iterator[tuple[Task, Row]]:
        for task in tasks:
            if len(done) == 3:
                done.append(task)
                raise KeyboardInterrupt
            done.append(task)
            yield task, before[task.key]

    monkeypatch.setattr(command, "judged", run)
    call = ["fleet", str(home / "fleet.yaml"), "--json", str(home / "told.json"), "-q"]
    assert main(call) == 130
    assert main(call) == 0
    assert 3 + 1 + len(here) - 3 == len(done)
    first = contents(home / "few.results")
    assert main(call) == 0
    assert 3 + 1 + len(here) - 3 == len(done)
    assert first == contents(home / "few.results")
    report = json.loads((home / "told.json").read_text())
    assert "2 of 4 plants need attention: P1 first" in report["verdict"]
    assert "P4" in {one["plant"] for one in report["not_judged"]}
    table = pyarrow.parquet.read_table(home / "few.results/findings").to_pylist()
    assert {("P1", "A.leakage"), ("P2", "A.leakage")} == {(r["plant"], r["fault"]) for r in table}
    page = (home / "few.results/ranking.html").read_text()
    assert f">{report['verdict']}</h1>" in page
    file = home / "recordings/plant=P2/day=2026-01-02/healthy.csv"
    os.utime(file, ns=(1, 1))
    monkeypatch.setattr(
        command, "judged", lambda _, tasks, *more: [(t, row_of(here, t)) for t in tasks]
    )
    assert main(call[:2]) == 0
    assert "1 is done" not in capsys.readouterr().err
    days = home / "few.results/plant-days/day=2026-01-02/plant=P2"
    assert len([*days.iterdir()]) == 1


def row_of(here: dict[Task, Row], task: Task) -> Row:
    """What is told of a plant-day whose file was touched."""
    (row,) = (r for t, r in here.items() if (t.plant, t.day) == (task.plant, task.day))
    return row | {"key": task.key}


def contents(folder: Path) -> dict[str, bytes]:
    return {str(f.relative_to(folder)): f.read_bytes() for f in folder.rglob("*") if f.is_file()}


def test_ranking_puts_the_worst_first() -> None:
    def row(plant: str, status: str, health: float | None) -> Row:
        day, judged = "2026-01-01", health is not None
        return {"plant": plant, "day": day, "status": status, "health": health, "judged": judged,
                "coverage": {"e": 0.4}.get(plant, health and 1.0),
                "found": int(status in "FM"), "text": status}  # fmt: skip

    rows = [row("a", "ok", 1.0), row("b", "M", 0.5), row("c", "F", 0.9), row("d", "unread", None),
            row("e", "C", 0.4)]  # fmt: skip
    plants = ranked(rows)
    assert ["c", "b", "e", "d", "a"] == [one.plant for one in plants]
    assert verdict(plants) == (
        "2 of 5 plants need attention: c first; 1 plant has days that could not be judged; "
        "1 is partly blind"
    )


def test_results_go_elsewhere_only_by_the_command(home: Path, capsys: Capsys) -> None:
    """A fleet that somebody sent writes below its own folder; hosts that it asks are told."""
    file, other = home / "elsewhere.yaml", home.parent / "other"
    file.write_text("fleet: few\nrecordings: recordings\njudged_by: abc.json\nresults: ../other\n")
    with pytest.raises(Refused, match="KB016"):
        read_fleet(file, ruleset_of)
    assert other == read_fleet(file, ruleset_of, other).results
    file.write_text("fleet: few\nrecordings: http://me:secret@127.0.0.1:1/x\njudged_by: abc.json\n")
    assert 1 == main(["fleet", str(file)])
    said = " ".join(capsys.readouterr().err.split())
    assert "few: recordings come from http://127.0.0.1 rulec: " in said
    assert "secret" not in said


FORM = {
    "verdict": "named",
    "headline": "The model lacks slip.",
    "effects": [{"effect": "slip", "title": "Slip", "probability": 0.97}],
    "locations": [{"module": "A", "place": "Q_geo"}],
    "fit": {
        "signal": "C.dp",
        "unit": "bar",
        "heldout": {"shipped": 3.0, "recalibrated": 2.0, "repaired": 1.0, "noise": 0.9},
    },
}


def test_rows_and_their_sentence(fleet: Fleet) -> None:
    """The answer is that of `rulec mismatch`; a file that is none is a reason. The sentence
    counts plants by what most of them differ, whatever the number of days; a row holds place,
    name, proof."""
    full, *_, few_columns, no_file = sorted(tasks_of(fleet), key=lambda t: (t.plant, t.day))
    few = answer_of(few_columns, ask_day(few_columns, str(ABC)))
    assert few["verdict"] == "cannot judge"
    assert few["text"].startswith("Cannot judge")
    broken = answer_of(no_file, ask_day(no_file, str(ABC)))
    assert broken["verdict"] == "unread"
    assert "broken.parquet" in broken["reason"]
    found = answer_of(full, FORM)
    assert (found["module"], found["place"], found["effect"]) == ("A", "Q_geo", "slip")
    assert (found["probability"], found["signal"]) == (0.97, "C.dp")
    assert (found["shipped"], found["repaired"]) == (3.0, 1.0)
    row = {"plant": "a", "day": "1", "verdict": "named", "title": "Slip"}
    rows = [row, row | {"day": "2"}, row | {"plant": "b"}, row | {"plant": "c", "title": "X"}]
    sound = row | {"plant": "d", "verdict": "none", "title": ""}
    assert summary([*rows, sound]) == (
        "3 of 4 plants differ from their models; most often by: Slip (2 plants)"
    )
    assert summary([sound]) == "1 plant agrees with its model"
    blind = sound | {"verdict": "cannot judge"}
    assert summary([blind]) == "no recording says anything of a model"


def test_answers_are_kept_and_give_one_table(
    home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is asked twice; the same answers give the same table and the same words."""
    put: list[str] = []

    def asked(_: Engine, left: list[Task], fleet: object) -> Iterator[tuple[Task, dict[str, Any]]]:
        del fleet
        for task in left:
            put.append(task.plant)
            yield task, FORM if len(put) == 4 else {"reason": "broken"}

    monkeypatch.setattr(command, "asked", asked)
    call = ["fleet", str(home / "fleet.yaml"), "--mismatch", "--json", str(home / "told.json")]
    assert main(call) == 0
    table = pyarrow.parquet.read_table(home / "few.results/mismatch.parquet")
    first = table.to_pylist()
    capsys.readouterr()
    assert main(call) == 0
    assert len(put) == len(RECORDED)
    assert first == pyarrow.parquet.read_table(home / "few.results/mismatch.parquet").to_pylist()
    out = capsys.readouterr().out
    assert "1 of 4 plants differs from its model" in " ".join(out.split())
    form = json.loads((home / "told.json").read_text())
    (named,) = (row for row in form["plant_days"] if row["verdict"] == "named")
    assert json.loads(Path(named["answer"]).read_text()) == FORM
