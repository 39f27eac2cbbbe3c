"""The command `rulec mismatch`: arguments, files, refusals. The analysis itself is replaced."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rulec_runtime.recordings.recording import Recording

from rulec.api import mismatch as command
from rulec.cli import main
from rulec.commands.mismatch import periods_of
from rulec.effects import model_builder
from rulec.mismatch import analyse as analysis
from rulec.mismatch.refused import MismatchRefused
from rulec.mismatch.result import Mismatch
from tests.conftest import ROOT, compiled
from tests.runtime.mismatches import NAMED, UNNAMED

PLANT = ROOT / "plants" / "abc"
RECORDING = PLANT / "examples" / "healthy.csv"


class Calls:
    """Stands in for the analysis: remembers how it was called."""

    def __init__(self) -> None:
        self.found: Mismatch = NAMED
        self.heldout: tuple[tuple[float, float], ...] | None = None
        self.sources: tuple[str, ...] = ()

    def analyse(
        self,
        recording: Recording,
        ruleset: object,
        builder: object,
        *,
        heldout: tuple[tuple[float, float], ...] = (),
        power: tuple[str, ...] | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Mismatch:
        assert len(recording) > 0
        self.sources = recording.sources
        assert "builder" == builder
        self.heldout = heldout
        if progress is not None:
            progress("locating [1/3]")
        return self.found


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Calls:
    """Analysis and builder replaced."""
    replaced = Calls()
    opened = SimpleNamespace(ruleset=compiled("abc"), sources="sources")
    monkeypatch.setattr(analysis, "analyse", replaced.analyse)
    monkeypatch.setattr(model_builder, "builder_of", lambda plant: "builder")
    monkeypatch.setattr(command, "open_plant", lambda path, effects: opened)
    monkeypatch.setattr(command, "basis_of", lambda sources, recordings, in_memory: {})
    return replaced


def call(*options: str) -> int:
    return main(["mismatch", str(PLANT), str(RECORDING), *options])


def test_story_goes_to_standard_output(calls: Calls, capsys: pytest.CaptureFixture[str]) -> None:
    """A mismatch is a result: exit code 0."""
    assert 0 == call()
    assert "◆ Physics left out of the model" in capsys.readouterr().out
    assert () == calls.heldout


def test_files_are_written(
    calls: Calls, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """JSON with the name of the recording and the plant as given, and the page."""
    assert 0 == call("--json", str(tmp_path / "m.json"), "--report", str(tmp_path / "m.html"))
    data = json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))
    assert ("healthy.csv", "named") == (data["recording"], data["verdict"])
    assert PLANT.as_posix() == data["repair"]["plant"]
    assert (tmp_path / "m.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert {"m.json", "m.html"} == {p.name for p in tmp_path.iterdir()}


def test_courses_are_written(
    calls: Calls, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where `--series` says, and told on the screen."""
    assert 0 == call("--series", str(tmp_path / "m.csv"))
    assert (tmp_path / "m.csv").read_text(encoding="utf-8").startswith("time [s],heldout [1]")
    assert "courses of the models" in capsys.readouterr().out


def test_course_of_a_hidden_driver_is_written_beside_the_json(
    calls: Calls, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its name stands in the JSON, without folder."""
    calls.found = UNNAMED
    assert 0 == call("--json", str(tmp_path / "m.json"))
    data = json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))
    assert "m.hidden.csv" == data["hidden_driver"]["series"]
    table = (tmp_path / "m.hidden.csv").read_text(encoding="utf-8")
    assert table.startswith("time [s],course [l/h]\n")


def test_json_on_standard_output_is_alone_there(
    calls: Calls, capsys: pytest.CaptureFixture[str]
) -> None:
    """The story goes to standard error, and no series is written anywhere."""
    calls.found = UNNAMED
    assert 0 == call("--json", "-")
    shown = capsys.readouterr()
    data: dict[str, Any] = json.loads(shown.out)
    assert data["hidden_driver"]["series"] is None
    assert "▲ A mismatch that nothing known explains" in shown.err


def test_held_out_periods_reach_the_analysis(
    calls: Calls, capsys: pytest.CaptureFixture[str]
) -> None:
    """Several are allowed."""
    assert 0 == call("--heldout", "0:10", "--heldout", "30:40.5")
    assert ((0.0, 10.0), (30.0, 40.5)) == calls.heldout


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("last", "--heldout last: give two numbers of seconds with a colon between, as in 600:900"),
        ("1:2:3", "--heldout 1:2:3: give two numbers of seconds"),
        ("5", "--heldout 5: give two numbers of seconds"),
        ("1:inf", "--heldout 1:inf: give two numbers of seconds"),
        ("nan:2", "--heldout nan:2: give two numbers of seconds"),
        (":", "--heldout :: give two numbers of seconds"),
        ("9:3", "--heldout 9:3: it ends before it begins; did you mean 3:9?"),
        ("3:3", "--heldout 3:3: it has no length"),
    ],
)
def test_broken_periods_are_refused_before_any_work(
    given: str, message: str, calls: Calls, capsys: pytest.CaptureFixture[str]
) -> None:
    """Wrong usage: exit code 2, one line that says how to write it."""
    assert 2 == call("--heldout", given)
    shown = capsys.readouterr().err
    assert f"rulec mismatch: {message}" in shown
    assert 1 == len(shown.splitlines())
    assert calls.heldout is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("500:600", "--heldout 500:600: the recording has no sample there; it runs from 0 s to"),
        ("-1:1e6", "--heldout takes the whole recording; leave a part"),
    ],
)
def test_periods_that_do_not_suit_the_recording_are_refused(
    given: str, message: str, calls: Calls, capsys: pytest.CaptureFixture[str]
) -> None:
    """Bad input: exit code 1, and where the recording lies."""
    assert 1 == call(f"--heldout={given}")
    assert message in capsys.readouterr().err
    assert calls.heldout is None


def test_refusals_of_the_analysis_are_messages(
    calls: Calls, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """No traceback."""

    def refuse(*_: object, **__: object) -> Mismatch:
        raise MismatchRefused("x.csv: no settled stretch was found")

    monkeypatch.setattr(analysis, "analyse", refuse)
    assert 1 == call()
    assert "rulec: x.csv: no settled stretch was found\n" == capsys.readouterr().err


def test_a_ruleset_is_not_enough(calls: Calls, capsys: pytest.CaptureFixture[str]) -> None:
    """Physics is built into equations, which a ruleset does not hold."""
    assert 2 == main(["mismatch", "abc.ruleset.json", str(RECORDING)])
    assert "abc.ruleset.json: give the plant's folder" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--json", "--report", "--series"])
def test_folder_of_a_result_must_exist(
    option: str, calls: Calls, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Said before the work, not after it."""
    target = str(tmp_path / "none" / "m.x")
    assert 2 == call(option, target)
    assert f"{option} {target}: there is no such folder" in capsys.readouterr().err
    assert calls.heldout is None


def test_progress_is_told_where_somebody_watches(
    calls: Calls, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Brackets in it are no markup."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    assert 0 == call()
    assert "◆" in capsys.readouterr().out


def test_periods_are_read_as_numbers() -> None:
    """Spaces and exponents do no harm; a negative time is a time."""
    assert ((-5.0, 0.0), (100.0, 2e3)) == periods_of(["-5:0", "1e2: 2e3"])


def test_several_recordings_reach_the_analysis_as_one(
    calls: Calls, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the order given; the story and the JSON name all."""
    other = str(PLANT / "examples" / "swapped.csv")
    assert 0 == call(other, "--json", str(tmp_path / "m.json"))
    assert ("healthy.csv", "swapped.csv") == calls.sources
    data = json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))
    assert "healthy.csv and swapped.csv" == data["recording"]
    assert "healthy.csv and swapped.csv" in capsys.readouterr().out


def test_a_recording_given_twice_is_refused(
    calls: Calls, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 1, which file, and what to do."""
    assert 1 == call(str(RECORDING))
    shown = capsys.readouterr().err
    assert "healthy.csv: this is the same file, given twice" in shown
    assert "Give each recording once" in shown


def test_several_recordings_of_a_plant_that_stores_are_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """With the way out."""
    plant = ROOT / "plants" / "cascaded-tanks"
    inputs = str(plant / "examples" / "inputs.csv")
    assert 1 == main(["mismatch", str(plant), inputs, inputs])
    shown = capsys.readouterr().err
    assert "this plant stores" in shown
    assert "Judge each recording alone" in shown
