"""A plant that is connected otherwise than its file says: told as that, with the line to edit."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from rulec.cli import main
from rulec.mismatch.structure.hypotheses import CONNECTION, Rewiring, rewirings
from rulec.mismatch.structure.wiring import hypothesis_of
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT
from tests.runtime.mismatch.made import opened

EXAMPLES = ROOT / "plants/abc/examples"


def stated(folder: Path, old: str, new: str) -> Path:
    """Plant abc with another line in its file."""
    plant = folder / "plant"
    plant.mkdir()
    shutil.copy(ROOT / "plants/abc/plant.yaml", plant)
    file = plant / "plant.yaml"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")
    return plant


def test_one_pipe_at_a_time_and_only_where_something_contradicts() -> None:
    """No pump is fed in this plant, and none is made to be."""
    plant = opened("abc")[1].network.plant
    found = rewirings(plant, {"A": 0.4, "C": 0.1}, 9)
    assert {Rewiring(("A", "C"), None), Rewiring(("B", "C"), None)} == set(found)
    assert ("A", "C") == found[0].stated
    assert () == rewirings(plant, {}, 9)
    rig = opened("mixing-rig")[1].network.plant
    many = rewirings(rig, dict.fromkeys(rig.modules, 1.0), 99)
    assert Rewiring(("D", "M2"), ("D", "M1")) in many
    assert all(r.fits is None or r.fits[1] in ("M1", "M2") for r in many)
    assert 5 == len(rewirings(rig, dict.fromkeys(rig.modules, 1.0), 5))


def test_a_plant_connected_otherwise_is_what_its_file_edited_so_compiles_to(tmp_path: Path) -> None:
    edited = compile_plant(stated(tmp_path, "  - B -> C\n", ""))
    ruleset, _ = opened("abc")[1].connected((("A", "C"),))
    for part in ("sources", "junctions", "observers", "residuals", "faults", "plan", "undo"):
        assert getattr(edited, part) == getattr(ruleset, part), part


def test_what_cannot_be_told_apart_is_told_together() -> None:
    moved, added = Rewiring(("A", "M1"), ("A", "M2")), Rewiring(None, ("A", "M3"))
    found = hypothesis_of(moved, [added], None)
    assert (
        "the plant file says A feeds M1; the readings fit A feeding M2 instead or A feeding M3 "
        "(they do not tell which)"
    ) == found.text
    assert "change 'A -> M1' to 'A -> M2' in plant.yaml or add 'A -> M3'" in found.action
    assert ("A.outlet",) == found.places


def test_the_answer_names_the_pipe_and_nothing_is_adopted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The search went on with the pipe in its place, and found nothing else."""
    plant, answer = stated(tmp_path, "  - B -> C\n", ""), tmp_path / "answer.json"
    words = ["mismatch", str(plant), str(EXAMPLES / "healthy.csv"), "--json", str(answer)]
    assert 0 == main(words)
    shown = " ".join(capsys.readouterr().out.split())
    said = "The plant file does not say that B feeds C; the readings fit B feeding C. Connected as"
    assert said in shown
    form = json.loads(answer.read_text(encoding="utf-8"))
    assert "named" == form["verdict"]
    (effect,) = form["effects"]
    assert (CONNECTION, "B", "B.outlet") == tuple(effect[k] for k in ("effect", "module", "place"))
    (pipe,) = form["repair"]["rewired"]
    assert (None, "B -> C") == (pipe["stated"], pipe["fits"])
    assert "plant.yaml, line 9" in pipe["edit"]
    for more in ([], ["--recalibrated"]):
        assert 0 != main(["adopt", str(answer), *more, "-o", str(tmp_path / "adopted")])
        refused = " ".join(capsys.readouterr().err.split())
        assert "add 'B -> C' to the connections in" in refused
        assert "plant.yaml, line 9" in refused
