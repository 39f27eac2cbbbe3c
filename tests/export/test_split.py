"""Modules apart and a central part apart give the findings of the whole."""

import io
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from rulec_runtime.diagnosis.from_modules import FIRST_ORDER, diagnose_results
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.module_results import read_results
from rulec_runtime.recordings.recording import read_recording

from rulec.cli import main
from rulec.export.play_on_recording import played, results_csv
from tests.conftest import ROOT, compiled
from tests.export.plants import codes
from tests.rig.exported.split import gaps, same_story, shipped, split

SAME = 1e-9
ABC = ROOT / "plants" / "abc"
QUICK = ("leakage_A.csv", "swapped.csv")


@pytest.mark.parametrize(
    ("plant", "recording"),
    [
        pytest.param(
            plant, file, id=file.stem, marks=() if file.name in QUICK else pytest.mark.prove
        )
        for plant, file in shipped()
    ],
)
def test_findings_are_those_of_the_whole(plant: Path, recording: Path, tmp_path: Path) -> None:
    """With mean readings beside the results; the code of modules is compiled."""
    found = split(compiled(plant.name), recording, tmp_path)
    assert same_story(found.whole, found.given)
    assert max(gaps(found.whole, found.given), default=0.0) < SAME
    assert found.whole.judged == found.given.judged


def test_without_readings_slopes_stand_for_the_equations(tmp_path: Path) -> None:
    """A clogging is then found, and its degree is too low; a note says why."""
    recording = tmp_path / "clogging.csv"
    inputs = str(ABC / "examples" / "healthy.csv")
    acts = ["--fault", "A.clogging=0.4@30:1000", "--noise", "2"]
    assert 0 == main(["simulate", str(ABC), inputs, "-o", str(recording), *acts])
    found = split(compiled("abc"), recording, tmp_path)
    (whole,), (first,) = found.whole.findings, found.first_order.findings
    assert whole.fault == first.fault
    assert 0.2 < first.degree < whole.degree - 0.03
    assert FIRST_ORDER in found.first_order.notes
    assert same_story(found.whole, found.given)


def results() -> pd.DataFrame:
    """Results of a shipped recording, as texts."""
    ruleset = compiled("abc")
    recording = read_recording(ABC / "examples" / "leakage_A.csv", ruleset)
    text = results_csv(played(recording, ruleset, codes("abc")))
    return pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)


def read(columns: pd.DataFrame, folder: Path) -> Any:
    columns.to_csv(folder / "r.csv", index=False)
    return read_results(folder / "r.csv", compiled("abc"))


def test_an_unfit_reading_is_left_out(tmp_path: Path) -> None:
    """The module flags it: what rests on it is not judged, the rest is."""
    columns = results().assign(**{"fit:A.P_el": "0", "valid:A.power": "0"})
    diagnosis = diagnose_results(read(columns, tmp_path), compiled("abc"))
    assert {"A.leakage"} <= {f.fault.id for f in diagnosis.findings}
    assert any(note.startswith("A.P_el: its module says") for note in diagnosis.notes)
    assert any("A.P_el: its module says" in p.text for p in diagnosis.not_judged)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"s:A.pump:A.dp": None}, "column 's:A.pump:A.dp' is missing"),
        ({"seconds": None}, "column 'seconds' is missing"),
        ({"time [s]": None}, "there is no time column"),
        ({"A.dp [bar]": None, "dq:A.pump:A.leakage": None}, "faults cannot be undone"),
        ({"A.dp [bar]": "A.dp [rpm]"}, "A.dp is measured in bar"),
        ({"samples": ""}, "no row has a time, seconds and samples"),
    ],
)
def test_what_does_not_suffice_is_refused(
    change: dict[str, str | None], expected: str, tmp_path: Path
) -> None:
    """With what is missing."""
    columns = results().drop(columns=[name for name, to in change.items() if to is None])
    columns = columns.rename(columns={name: to for name, to in change.items() if to})
    columns = columns.assign(**dict.fromkeys((n for n, to in change.items() if to == ""), "x"))
    with pytest.raises(RecordingRefused, match=expected.replace("[", r"\[")):
        diagnose_results(read(columns, tmp_path), compiled("abc"))


@pytest.mark.parametrize(("language", "ends"), [("c", {".h", ".c"}), ("st", {".st"})])
def test_the_command_writes_all_modules(language: str, ends: set[str], tmp_path: Path) -> None:
    """Files per module, and which variable is what."""
    assert 0 == main(["export", str(ABC), "--to", language, "-o", str(tmp_path / "code")])
    files = {f.name for f in (tmp_path / "code").iterdir()}
    assert {"wiring.csv"} | {f"{m}{end}" for m in "ABC" for end in ends} == files
    wiring = (tmp_path / "code" / "wiring.csv").read_text(encoding="utf-8")
    assert "A,observe,in,dp,LREAL,bar,A.dp," in wiring
    assert "A,observe,out,pump,LREAL,m3/s,q:A.pump," in wiring
