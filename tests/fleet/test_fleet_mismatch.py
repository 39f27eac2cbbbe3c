"""What the models of many plants leave out: a row each, whatever is wrong with a recording."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest
from rulec_runtime.fleet.plant_day import Task

from rulec.api.arguments import ruleset_of
from rulec.cli import main
from rulec.commands import fleet_mismatch
from rulec.commands.fleet_mismatch import Answer, answer_of, ask_day, summary
from rulec.engines.call import Engine
from rulec.fleet.fleet_file import read_fleet
from rulec.fleet.plant_days import tasks_of
from tests.conftest import ROOT
from tests.fleet.test_fleet import FEW, recorded

ABC = ROOT / "plants/abc"

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


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four plants: one of them has few columns, one a file that is none."""
    files = {"north": "healthy.csv", "south": "warm_A.csv", "west": FEW, "east": ""}
    days = {(plant, "2026-01-01"): name for plant, name in files.items()}
    return recorded(tmp_path_factory.mktemp("many"), days, f"judged_by: {ABC}")


@pytest.fixture(scope="module")
def tasks(home: Path) -> dict[str, Task]:
    return {task.plant: task for task in tasks_of(read_fleet(home / "fleet.yaml", ruleset_of))}


def test_rows_and_their_sentence(tasks: dict[str, Task]) -> None:
    """The answer is that of `rulec mismatch`; a file that is none is a reason. The sentence
    counts plants by what most of them differ, whatever the number of days; a row holds place,
    name, proof."""
    few = answer_of(tasks["west"], ask_day(tasks["west"], str(ABC)))
    assert few.verdict == "cannot judge"
    assert few.text.startswith("Cannot judge")
    broken = answer_of(tasks["east"], ask_day(tasks["east"], str(ABC)))
    assert broken.verdict == "unread"
    assert "broken.parquet" in broken.reason
    full = answer_of(tasks["south"], FORM)
    assert (full.module, full.place, full.effect) == ("A", "Q_geo", "slip")
    assert (full.probability, full.signal, full.shipped, full.repaired) == (0.97, "C.dp", 3.0, 1.0)
    row = Answer(plant="a", day="1", verdict="named", title="Slip")
    rows = [row, replace(row, day="2"), replace(row, plant="b"), replace(row, plant="c", title="X")]
    sound = replace(row, plant="d", verdict="none", title="")
    assert summary([*rows, sound]) == (
        "3 of 4 plants differ from their models; most often by: Slip (2 plants)"
    )
    assert summary([sound]) == "1 plant agrees with its model"
    blind = replace(sound, verdict="cannot judge")
    assert summary([blind]) == "no recording says anything of a model"


def test_it_goes_on_where_it_was_stopped(
    home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is asked twice; the same answers give the same table and the same words."""
    put: list[str] = []

    def asked(_: Engine, left: list[Task], fleet: object) -> Iterator[tuple[Task, dict[str, Any]]]:
        del fleet
        for task in left:
            if len(put) == 2:
                put.append("stopped")
                raise KeyboardInterrupt
            put.append(task.plant)
            yield task, FORM if task.plant == "south" else {"reason": "broken"}

    monkeypatch.setattr(fleet_mismatch, "asked", asked)
    call = ["fleet", str(home / "fleet.yaml"), "--mismatch", "--json", str(home / "told.json")]
    assert main(call) == 130
    assert main(call) == 0
    assert sorted([*put[:2], *put[3:]]) == ["east", "north", "south", "west"]
    table = pyarrow.parquet.read_table(home / "few.results/mismatch.parquet")
    first = table.to_pylist()
    capsys.readouterr()
    assert main(call) == 0
    assert len(put) == 5
    assert first == pyarrow.parquet.read_table(home / "few.results/mismatch.parquet").to_pylist()
    out = capsys.readouterr().out
    assert "1 of 4 plants differs from its model" in " ".join(out.split())
    form = json.loads((home / "told.json").read_text())
    (south,) = (row for row in form["plant_days"] if row["plant"] == "south")
    assert json.loads(Path(south["answer"]).read_text()) == FORM
