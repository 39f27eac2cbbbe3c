"""The command `rulec mismatch`: arguments, files, refusals. The analysis itself is replaced."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rulec_runtime.recordings.recording import Recording

from rulec.cli import main
from rulec.commands import mismatch as command
from rulec.effects import model_builder
from rulec.mismatch import analyse as analysis
from tests.conftest import ROOT, Capsys, compiled
from tests.runtime.mismatches import NAMED, UNNAMED

PLANT = ROOT / "plants" / "abc"
RECORDING = PLANT / "examples" / "healthy.csv"


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Analysis and builder replaced: what is found, and the periods that were held out."""
    replaced = SimpleNamespace(found=NAMED, heldout=None)
    opened = SimpleNamespace(ruleset=compiled("abc"), sources="sources")

    def analyse(recording: Recording, ruleset: object, builder: object, **how: Any) -> Any:
        assert len(recording) > 0
        assert "builder" == builder
        replaced.heldout = how["heldout"]
        return replaced.found

    monkeypatch.setattr(analysis, "analyse", analyse)
    monkeypatch.setattr(model_builder, "builder_of", lambda plant: "builder")
    monkeypatch.setattr(command, "open_plant", lambda path, effects: opened)
    monkeypatch.setattr(command, "basis_of", lambda sources, recordings, in_memory: {})
    return replaced


def call(*options: str) -> int:
    return main(["mismatch", str(PLANT), str(RECORDING), *options])


def test_files_are_written(calls: SimpleNamespace, tmp_path: Path, capsys: Capsys) -> None:
    """JSON with the name of the recording and the plant as given, the page, courses of the models,
    and, beside the JSON, that of a hidden driver. A mismatch is a result: exit code 0."""
    form, page, courses = (tmp_path / name for name in ("m.json", "m.html", "m.csv"))
    assert 0 == call("--json", str(form), "--report", str(page), "--series", str(courses))
    shown = capsys.readouterr().out
    assert "◆ Physics left out of the model" in shown
    assert "courses of the models" in shown
    data = json.loads(form.read_text(encoding="utf-8"))
    assert ("healthy.csv", "named") == (data["recording"], data["verdict"])
    assert PLANT.as_posix() == data["repair"]["plant"]
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert courses.read_text(encoding="utf-8").startswith("time [s],heldout [1]")
    assert {"m.json", "m.html", "m.csv"} == {p.name for p in tmp_path.iterdir()}
    calls.found = UNNAMED
    periods = ("--heldout=-5:10", "--heldout", "3e1: 40.5")
    assert 0 == call("--json", str(form), *periods)
    assert ((-5.0, 10.0), (30.0, 40.5)) == calls.heldout
    data = json.loads(form.read_text(encoding="utf-8"))
    assert "m.hidden.csv" == data["hidden_driver"]["series"]
    table = (tmp_path / "m.hidden.csv").read_text(encoding="utf-8")
    assert table.startswith("time [s],course [l/h]\n")


def test_json_on_standard_output_is_alone_there(calls: SimpleNamespace, capsys: Capsys) -> None:
    """The story goes to standard error, and no series is written anywhere."""
    calls.found = UNNAMED
    assert 0 == call("--json", "-")
    shown = capsys.readouterr()
    data: dict[str, Any] = json.loads(shown.out)
    assert data["hidden_driver"]["series"] is None
    assert "▲ A mismatch that nothing known explains" in shown.err
