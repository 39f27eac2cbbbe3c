"""Real recordings in the form of the proof: asked like sealed cases, and told in one table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.output.terminal import Terminal

from rulec.engines.call import Engine
from rulec.mismatch.answer.json_form import mismatch_form
from rulec.prove.campaign import Changed
from rulec.prove.command import main
from tests.conftest import recordings_folder
from tests.figures.commands import picked
from tests.figures.ledger import read_ledger
from tests.prove.__main__ import form as errors_of
from tests.prove.real import SOURCES, Answer, answers
from tests.prove.tell_real import tell_real
from tests.rig.esp import FOLDER
from tests.runtime.mismatches import NAMED, UNNAMED

WIDTH = 100


def quiet(what: str, done: int, all_: int) -> None:
    """Nobody watches."""


def told(form: dict[str, Any]) -> str:
    """The table of one answer, as a terminal shows it."""
    out = Terminal(width=WIDTH, color_system=None)
    with out.capture() as shown:
        tell_real(out, [Answer("rig", "abc", form)], [])
    return shown.get()


@pytest.mark.prove
def test_a_quick_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A pump that was calibrated on water meets glycerin; what is absent is told, with a reason."""
    found = recordings_folder() / FOLDER
    if not found.is_dir():
        pytest.skip(f"no real recordings at {found} (set RULEC_RECORDINGS)")
    recordings, work, target = (tmp_path / name for name in ("there", "work", "forms.json"))
    recordings.mkdir()
    (recordings / FOLDER).symlink_to(found.resolve())
    monkeypatch.setenv("RULEC_RECORDINGS", str(recordings))
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    asked = ["--real", "--only=P37 one", "--jobs=1", f"--keep={work}", f"--json={target}"]
    assert 0 == main(asked)
    said = capsys.readouterr().out
    (form,) = json.loads(target.read_text(encoding="utf-8")).values()
    assert "named" == form["verdict"]
    for fit in form["fits"]:
        held = fit["heldout"]
        assert held["repaired"] < 0.1 * held["recalibrated"]
    assert all(effect["effect"] in said for effect in form["effects"])
    absent = [s.folder for s in SOURCES if s.folder != FOLDER]
    assert absent == [a for a in absent if f"skipped: {a}: not in {recordings}" in said]


def test_a_run_of_another_kind_is_refused(tmp_path: Path) -> None:
    """A folder holds concealed effects or real recordings; and real ones go on."""
    mine = tmp_path / "mine"
    mine.mkdir()
    for _ in range(2):
        assert [] == answers(tmp_path, mine, "", Engine(jobs=1), quiet)[0]
    (tmp_path / "seals.txt").write_text("another\n")
    with pytest.raises(Changed, match="another run"):
        answers(tmp_path, tmp_path, "", Engine(jobs=1), quiet)


@pytest.mark.parametrize("mismatch", [NAMED, UNNAMED])
def test_answers_fit_a_terminal(mismatch: Any) -> None:
    """Verdict, place and the error that is left, in 100 columns."""
    form = mismatch_form(mismatch, "plant.yaml")
    said = told(form)
    assert max(map(len, said.splitlines())) <= WIDTH
    assert mismatch.verdict in said
    assert form["fits"][0]["signal"] in said


def test_what_is_not_explained_is_told() -> None:
    """Free curves have no name, repairs that did harm a mark, and a rest a place."""
    form = mismatch_form(NAMED, "plant.yaml")
    form["notes"] = ["what is left is not noise: an error of A.h; no entry does"]
    form["effects"][0]["sort"] = "free"
    form["fits"][0]["heldout"] |= {"recalibrated": 1.0, "repaired": 3.0, "noise": 2.0}
    said = told(form)
    assert "• free curve, no name, at" in said
    assert "• not explained: an error of A.h" in said
    assert "▲ 1.5" in said


def test_errors_are_picked_for_the_ledger() -> None:
    """By recording and signal, as the keys of its real recordings say; none without an answer."""
    form = mismatch_form(NAMED, "plant.yaml")
    held = {fit["signal"]: fit["heldout"]["repaired"] for fit in form["fits"]}
    found = errors_of([Answer("rig", "abc", form), Answer("other", "abc", {"error": "none"})])
    for signal, repaired in held.items():
        assert repaired == picked(found, f"rig/{signal}/repaired").value
    assert {} == found["other"]
    real = [f for f in read_ledger().figures.values() if f.id.startswith("real.")]
    assert all(f"--only '{f.key.split('/')[0]}' " in f.command for f in real)


def test_no_answer_is_told() -> None:
    """With its message, and without errors."""
    said = told({"error": "ValueError: [no] answer", "seconds": 1.0})
    assert "no answer" in said
    assert "[no]" in said


def test_there_is_no_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Said before long work."""
    assert 2 == main(["--real", f"--report={tmp_path / 'page.html'}"])
    assert "--report: there is no page of real recordings" in capsys.readouterr().err


def test_a_name_that_no_recording_has_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An empty table would look like an answer."""
    (tmp_path / "there").mkdir()
    monkeypatch.setenv("RULEC_RECORDINGS", str(tmp_path / "there"))
    assert 2 == main(["--real", "--only=nowhere", f"--keep={tmp_path / 'work'}"])
    assert "--only nowhere: no recording that is here has this name" in capsys.readouterr().err
