"""Columns that are not what their header says: told as such, and nothing else is."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.cli import main
from rulec.mismatch.structure.hypotheses import SIGN, SWAPPED, UNIT, AcceptedHypothesis
from rulec.mismatch.structure.settled import Settled
from rulec.mismatch.structure.stores import Stores
from rulec.mismatch.structure.structure_search import structure_of
from tests.conftest import ROOT
from tests.runtime.mismatch.made import opened
from tests.runtime.tanks import made

TANKS = "wastewater-lab"


def example(plant: str, name: str) -> Recording:
    """A recording that is shipped."""
    return read_recording(ROOT / "plants" / plant / "examples" / f"{name}.csv", opened(plant)[0])


def looked(plant: str, recording: Recording) -> tuple[AcceptedHypothesis, ...]:
    """What is found in a recording."""
    kind = Stores if plant == TANKS else Settled
    return structure_of(recording, kind(*opened(plant), ()), lambda text: None).taken


def swapped(one: str, other: str) -> Mending:
    return Mending(signals=(one, other))


def times(name: str, factor: float) -> Mending:
    return Mending(signals=(name,), factor=factor)


def rig(*case: object) -> Any:
    return pytest.param("mixing-rig", *case, marks=pytest.mark.prove)


@pytest.mark.parametrize(
    ("plant", "name", "wrong", "kind", "text"),
    [
        ("abc", "calibration", swapped("A.n", "B.n"), SWAPPED, "A.n and B.n are swapped"),
        # One operating state repeated: what checks both readings says it all the same.
        ("abc", "healthy", swapped("B.dp", "C.dp"), SWAPPED, "B.dp and C.dp are swapped"),
        # Most of its readings are then impossible.
        ("abc", "calibration", times("A.dp", 100.0), UNIT, "A.dp is in kPa, not bar"),
        ("abc", "calibration", times("C.dp", 0.1), UNIT, "C.dp is in MPa, not bar"),
        ("abc", "calibration", times("C.dp", -1.0), SIGN, "C.dp has the wrong sign"),
        # Physics is missing besides.
        ("abc", "warm_A", swapped("A.P_el", "B.P_el"), SWAPPED, "A.P_el and B.P_el are swapped"),
        rig("calibration", times("M2.dp", 100.0), UNIT, "M2.dp is in kPa, not bar"),
        rig("calibration", swapped("D.dp", "E.dp"), SWAPPED, "D.dp and E.dp"),
        (TANKS, "", swapped("tank1.l", "tank2.l"), SWAPPED, "tank1.l and tank2.l are swapped"),
        (TANKS, "", times("tank1.l", 0.1), UNIT, "tank1.l is in cm, not mm: its values are 10 tim"),
        (TANKS, "", times("supply.Q", -1.0), SIGN, "supply.Q has the wrong sign"),
    ],
)
def test_a_wrong_column_is_told(
    plant: str, name: str, wrong: Mending, kind: str, text: str
) -> None:
    """That one, and no other."""
    recording = made(TANKS, 1) if plant == TANKS else example(plant, name)
    (found,) = looked(plant, wrong.of(recording))
    assert kind == found.hypothesis.kind
    assert text in found.hypothesis.text
    assert found.probability > (0.0 if plant == TANKS else 0.9)


@pytest.mark.parametrize(
    ("plant", "name"),
    [("abc", "healthy"), ("abc", "warm_A"), ("abc", "leakage_A"), rig("clogging_D")],
)
def test_physics_and_faults_are_no_wrong_columns(plant: str, name: str) -> None:
    """Not in tanks either, with a leak and without."""
    assert () == looked(plant, example(plant, name))
    assert () == looked(TANKS, made(TANKS, 1))
    faults = sorted(f.id for f in opened(TANKS)[0].faults if f.id.startswith("tank1."))
    assert () == looked(TANKS, made(TANKS, 1, (faults[0], 0.3, 0.5)))


def rewritten(file: Path, column: str, by: Callable[[list[str]], list[str]]) -> Path:
    """The shipped calibration recording with another column."""
    text = (ROOT / "plants/abc/examples/calibration.csv").read_text(encoding="utf-8")
    head, *rows = csv.reader(text.splitlines())
    place = head.index(column)
    for row, value in zip(rows, by([row[place] for row in rows]), strict=True):
        row[place] = value
    with file.open("w", encoding="utf-8", newline="") as out:
        csv.writer(out).writerows([head, *rows])
    return file


def test_the_answer_tells_it_first_and_its_plant_can_be_adopted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A pressure in kPa below a header that says bar; what is adopted is tried on the recording
    read as it should be."""
    answer, page = tmp_path / "answer.json", tmp_path / "answer.html"
    file = rewritten(
        tmp_path / "recording.csv",
        "A.dp [bar]",
        lambda column: [f"{100.0 * float(v):.6g}" if v else "" for v in column],
    )
    options = ["--json", str(answer), "--report", str(page)]
    assert 0 == main(["mismatch", str(ROOT / "plants/abc"), str(file), *options])
    told = "A.dp is in kPa, not bar"
    assert f"{told}: its values are 100 times" in " ".join(capsys.readouterr().out.split())
    assert told in page.read_text(encoding="utf-8")
    form = json.loads(answer.read_text(encoding="utf-8"))
    assert "sensor" == form["verdict"]
    assert ("wrong-unit", "A.dp") == tuple(form["effects"][0][k] for k in ("effect", "place"))
    assert ("A", "dp") == tuple(form["locations"][0][k] for k in ("module", "place"))
    assert form["next"].startswith("Write kPa as the unit of A.dp")
    assert any(note.startswith("all results, and what is adopted") for note in form["notes"])
    target = tmp_path / "adopted"
    assert 0 == main(["adopt", str(answer), "--recalibrated", "-o", str(target)])
    # Without that, the readings are not the ones that the plant was fitted to.
    form["repair"]["misread"] = [{**form["repair"]["misread"][0], "signals": ["A.none"]}]
    answer.write_text(json.dumps(form), encoding="utf-8")
    assert 0 != main(["adopt", str(answer), "--recalibrated", "-o", str(tmp_path / "other")])
