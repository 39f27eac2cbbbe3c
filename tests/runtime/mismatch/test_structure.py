"""Columns that are not what their header says or of another clock, and pipes that lie elsewhere."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.recording import Recording, read_recording
from scipy.signal import lfilter

from rulec.cli import main
from rulec.mismatch.structure.hypotheses import (
    CONNECTION,
    SIGN,
    SWAPPED,
    UNIT,
    AcceptedHypothesis,
    Rewiring,
    rewirings,
)
from rulec.mismatch.structure.settled import Settled
from rulec.mismatch.structure.stores import Stores
from rulec.mismatch.structure.structure_search import structure_of
from rulec.mismatch.structure.wiring import hypothesis_of
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT, Capsys
from tests.runtime import sheets
from tests.runtime.mismatch.made import changed, loaded, recorded, sampled, tour, without
from tests.runtime.sheets import Sheet
from tests.runtime.tanks import made

TANKS = "wastewater-lab"
EXAMPLES = ROOT / "plants/abc/examples"


def example(plant: str, name: str) -> Recording:
    return read_recording(ROOT / "plants" / plant / "examples" / f"{name}.csv", loaded(plant)[0])


def looked(plant: str, recording: Recording) -> tuple[AcceptedHypothesis, ...]:
    kind = Stores if plant == TANKS else Settled
    return structure_of(recording, kind(*loaded(plant), ()), lambda text: None).taken


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
    recording = made(TANKS, 1, count=600) if plant == TANKS else example(plant, name)
    (found,) = looked(plant, wrong.of(recording))
    assert kind == found.hypothesis.kind
    assert text in found.hypothesis.text
    assert found.probability > (0.0 if plant == TANKS else 0.9)


@pytest.mark.parametrize(
    ("plant", "name"),
    [("abc", "healthy"), ("abc", "warm_A"), ("abc", "leakage_A"), rig("clogging_D")],
)
def test_physics_and_faults_are_no_wrong_columns(plant: str, name: str) -> None:
    assert () == looked(plant, example(plant, name))


def test_nor_are_those_of_tanks() -> None:
    assert () == looked(TANKS, made(TANKS, 1, count=600))
    faults = sorted(f.id for f in loaded(TANKS)[0].faults if f.id.startswith("tank1."))
    assert () == looked(TANKS, made(TANKS, 1, (faults[0], 0.3, 0.5), count=600))


CALIBRATION = sheets.example("calibration")


def answered(folder: Path, sheet: Sheet, capsys: Capsys, *options: str) -> tuple[Any, str]:
    """What is told of a shipped recording with another column: a failing sensor."""
    file, answer = sheets.write(folder, sheet.text()), folder / "answer.json"
    words = ["mismatch", str(ROOT / "plants/abc"), str(file), "--json", str(answer), *options]
    assert 0 == main(words)
    form = json.loads(answer.read_text(encoding="utf-8"))
    assert "sensor" == form["verdict"]
    return form, " ".join(capsys.readouterr().out.split())


def test_the_answer_tells_it_first_and_its_plant_can_be_adopted(
    tmp_path: Path, capsys: Capsys
) -> None:
    """Most of the readings of its sensor are impossible as they stand."""
    answer, page = tmp_path / "answer.json", tmp_path / "answer.html"
    sound = sheets.example("healthy")
    bent = sound.mapped("A.dp", lambda _, cell: f"{100.0 * float(cell):.6g}")
    form, shown = answered(tmp_path, bent, capsys, "--report", str(page))
    text = "A.dp is in kPa, not bar"
    assert f"{text}: its values are 100 times" in shown
    assert text in page.read_text(encoding="utf-8")
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


def off(recording: Recording, signals: tuple[str, ...], late: float) -> Recording:
    return Mending(signals=signals, late=-late).of(recording)


def test_readings_are_moved_in_time_within_their_file() -> None:
    values = np.arange(8.0)
    recording = replace(
        sampled({"A.n": values, "A.dp": values}), time=5.0 * values, segment=np.arange(8) // 4
    )
    found = Mending(signals=("A.n",), late=10.0).of(recording).values
    assert np.array_equal(found["A.n"], [2, 3, np.nan, np.nan, 6, 7, np.nan, np.nan], True)
    assert np.array_equal(found["A.dp"], values)
    both = Mending(signals=("A.n", "A.dp"), late=-5.0).of(recording).values
    assert np.array_equal(both["A.dp"], [np.nan, 0, 1, 2, np.nan, 4, 5, 6], True)
    assert np.array_equal(both["A.n"], both["A.dp"], True)


def run(seed: int) -> Recording:
    return recorded(loaded("abc"), tour(loaded("abc")[0], 400, dwell=40), seed=seed)


OF_A = ("A.n", "A.dp", "A.P_el")


@pytest.mark.parametrize(
    ("signals", "late", "expected"),
    [
        (("A.P_el",), 12.0, "12 s too late"),
        (("C.dp",), -3.0, "3 s too early"),
        (OF_A, -5.0, "5 s too early"),
    ],
)
def test_columns_of_another_clock_are_found(
    signals: tuple[str, ...], late: float, expected: str
) -> None:
    """Of one reading or of all of a module."""
    (found,) = looked("abc", off(run(2), signals, late))
    assert set(signals) == set(found.hypothesis.mending.signals)
    assert late == found.hypothesis.mending.late
    assert expected in found.hypothesis.text


def test_nothing_is_told_of_one_clock() -> None:
    """Nor where states of ten samples are shorter than the shift: read three later, every state
    would be compared with the one before."""
    for seed in (1, 2):
        assert () == looked("abc", without(run(seed), "A.l"))
    assert () == looked("abc", off(example("abc", "calibration"), ("A.P_el",), 13.0))


@pytest.mark.parametrize(("signal", "pace"), [("A.P_el", 2.0), ("C.dp", 6.0), ("A.n", 6.0)])
def test_a_lag_is_no_clock(signal: str, pace: float) -> None:
    recording, share = run(3), np.exp(-1.0 / pace)
    first = recording.values[signal][0]
    late = lfilter([1.0 - share], [1.0, -share], recording.values[signal] - first) + first
    assert () == looked("abc", changed(recording, {signal: late}))


@pytest.mark.parametrize(
    ("seed", "signal", "late"),
    [
        (1, "tank1.l", -124.0),
        pytest.param(5, "supply.Q", 44.0, marks=pytest.mark.prove),
    ],
)
def test_a_plant_that_stores_cannot_answer_before_its_cause(
    seed: int, signal: str, late: float
) -> None:
    (found,) = looked(TANKS, off(made(TANKS, seed), (signal,), late))
    assert found.hypothesis.mending == Mending(signals=(signal,), late=late)


@pytest.mark.parametrize(("signal", "late"), [("tank1.l", 60.0), ("supply.Q", -60.0)])
def test_what_a_delay_of_the_catalogue_explains_is_left_to_it(signal: str, late: float) -> None:
    assert () == looked(TANKS, off(made(TANKS, 3), (signal,), late))


@pytest.mark.prove
def test_the_answer_says_by_how_much_and_is_adopted(tmp_path: Path, capsys: Capsys) -> None:
    power = [row[CALIBRATION.index("A.P_el")] for row in CALIBRATION.rows]
    late = CALIBRATION.mapped("A.P_el", lambda k, _: power[k - 4])
    form, shown = answered(tmp_path, late, capsys)
    assert "A.P_el is recorded 4 s too late against the others" in shown
    assert ("clock-shift", "A.P_el") == tuple(form["effects"][0][k] for k in ("effect", "place"))
    assert 4.0 == form["repair"]["misread"][0]["late"]
    answer = str(tmp_path / "answer.json")
    assert 0 == main(["adopt", answer, "--recalibrated", "-o", str(tmp_path / "adopted")])


def without_a_pipe(folder: Path) -> Path:
    """Plant abc, whose file does not say that B feeds C."""
    text = (ROOT / "plants/abc/plant.yaml").read_text(encoding="utf-8")
    assert "  - B -> C\n" in text
    (folder / "plant").mkdir()
    shutil.copy(ROOT / "plants/abc/calibration.yaml", folder / "plant")
    file = folder / "plant" / "plant.yaml"
    file.write_text(text.replace("  - B -> C\n", ""), encoding="utf-8")
    return file.parent


def test_one_pipe_at_a_time_and_only_where_something_contradicts() -> None:
    """No pump is fed in this plant, and none is made to be."""
    plant = loaded("abc")[1].network.plant
    found = rewirings(plant, {"A": 0.4, "C": 0.1}, 9)
    assert {Rewiring(("A", "C"), None), Rewiring(("B", "C"), None)} == set(found)
    assert ("A", "C") == found[0].stated
    assert () == rewirings(plant, {}, 9)
    rig = loaded("mixing-rig")[1].network.plant
    many = rewirings(rig, dict.fromkeys(rig.modules, 1.0), 99)
    assert Rewiring(("D", "M2"), ("D", "M1")) in many
    assert all(r.fits is None or r.fits[1] in ("M1", "M2") for r in many)
    assert 5 == len(rewirings(rig, dict.fromkeys(rig.modules, 1.0), 5))


def test_a_plant_connected_otherwise_is_what_its_file_edited_so_compiles_to(tmp_path: Path) -> None:
    edited = compile_plant(without_a_pipe(tmp_path))
    ruleset, _ = loaded("abc")[1].connected((("A", "C"),))
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


def test_the_answer_names_the_pipe_and_nothing_is_adopted(tmp_path: Path, capsys: Capsys) -> None:
    plant, answer = without_a_pipe(tmp_path), tmp_path / "answer.json"
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
