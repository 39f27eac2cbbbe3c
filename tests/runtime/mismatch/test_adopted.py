"""The chain: compare, adopt, compile, simulate. The adopted plant is as good as was promised."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.recordings.columns import thinned
from rulec_runtime.recordings.recording import read_recording

from rulec.cli import main
from rulec.effects.model_builder import open_builder
from rulec.effects.write_plant import trial
from rulec.mismatch import limits
from rulec.mismatch.answer.json_form import mismatch_form
from rulec.mismatch.answer.written_plant import row_errors, simulated, written
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.model import HELDOUT
from rulec.mismatch.evidence.steady.repaired_model import predictors_for, repair_of
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.evidence.stores.fit import plain_end
from rulec.mismatch.inference.heldout_errors import course_of, heldout_spans, series_csv
from rulec.mismatch.result import Course, Series
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT, Capsys
from tests.dosing import write_csv
from tests.runtime.mismatch.dynamic.problems import explained, made, problem_of, tanks
from tests.runtime.mismatch.made import (
    SLIP,
    USUAL,
    alone,
    changed,
    columns,
    compared,
    fitted,
    prepared,
    recorded,
    tour,
    warmed,
    warming,
)
from tests.runtime.mismatches import CANNOT_JUDGE, NAMED

Form = dict[str, Any]


@pytest.fixture(scope="module")
def analysed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plant whose type lies deep in its own knowledge base, a recording, and the comparison."""
    folder: Path = tmp_path_factory.mktemp("public")
    shutil.copytree(ROOT / "kb", folder / "kb")
    deep = folder / "kb" / "own" / "pumps"
    deep.mkdir(parents=True)
    (folder / "kb" / "modules" / "dosing-pcp.yaml").rename(deep / "pump.yaml")
    shutil.copy(Path(__file__).parent / "plant.yaml", folder / "plant.yaml")
    recording = warmed({SLIP: {"b": 0.1, "T0": USUAL}}, 144, seed=3)
    columns = {"time [s]": recording.time}
    for signal in alone()[0].signals:
        if signal.id in recording.values:
            shown = (recording.values[signal.id] - signal.offset) / signal.factor
            columns[f"{signal.id} [{signal.unit}]"] = shown
    write_csv(folder / "run.csv", columns, 9)
    plant, run, found = (str(folder / n) for n in ("plant.yaml", "run.csv", "found.json"))
    assert 0 == main(["mismatch", plant, run, "--json", found])
    return folder


@pytest.fixture
def folder(analysed: Path, tmp_path: Path) -> Path:
    """All of it again, where a test may change it; the machine form speaks of these files."""
    place = tmp_path / "work"
    shutil.copytree(analysed, place)
    text = (place / "found.json").read_text(encoding="utf-8")
    text = text.replace(analysed.as_posix(), place.as_posix())
    (place / "found.json").write_text(text, encoding="utf-8")
    return place


def form_in(folder: Path) -> Form:
    form: Form = json.loads((folder / "found.json").read_text(encoding="utf-8"))
    return form


def adopt(folder: Path, *options: str) -> int:
    return main(["adopt", str(folder / "found.json"), "-o", str(folder / "new"), *options])


def refused(folder: Path, capsys: Capsys, change: Callable[[Form], object] | None = None) -> str:
    """What is said where nothing is adopted; no half-written folder stays behind."""
    if change is not None:
        form = form_in(folder)
        change(form)
        (folder / "found.json").write_text(json.dumps(form), encoding="utf-8")
    before = sorted(folder.iterdir())
    assert 1 == adopt(folder)
    assert before == sorted(folder.iterdir())
    return " ".join(capsys.readouterr().err.split())


def simulated_errors(folder: Path) -> dict[str, float]:
    """Errors of the new plant over all held-out rows, by the commands alone."""
    run, target, plant = folder / "run.csv", folder / "simulated.csv", folder / "new"
    assert 0 == main(["simulate", str(plant), str(run), "-o", str(target)])
    rules = compile_plant(plant)
    measured, predicted = read_recording(run, rules), read_recording(target, rules)
    spans, time = form_in(folder)["split"]["heldout"], measured.time
    inside = np.any([(time >= a) & (time <= b) for a, b in spans], axis=0)
    return {
        name: float(np.sqrt(np.nanmean((values - measured.values[name])[inside] ** 2)))
        / rules.signal_by_id[name].factor
        for name, values in predicted.values.items()
    }


def test_told_is_what_the_written_plant_gives(folder: Path) -> None:
    """By the commands alone, and at points by each relation solved for the reading."""
    assert 0 == adopt(folder)
    form, errors = form_in(folder), simulated_errors(folder)
    assert ["slip-temperature"] == [e["effect"] for e in form["effects"]]
    assert form["repair"]["checks"]
    for check in form["repair"]["checks"]:
        assert check["error"] == pytest.approx(errors[check["signal"]], rel=1e-5)
    rules, builder = open_builder(folder / "new")
    assert "A.T" in rules.observer_by_id["A.pump"].signals
    # The points of the old plant: the new one wants the temperature settled as well.
    data = prepared(alone()[0], read_recording(folder / "run.csv", rules))
    system, fit = System(rules, builder, data), form["fit"]
    own = predictors_for(system, ("A.pump", "A.power"), frozenset({"A.dp", "A.T"}))
    predictor = next(p for p in own if p.signal.id == fit["signal"])
    off = data.values[predictor.signal.id] - predictor.predicted(Configuration())
    heldout = predictor.points & (data.part == HELDOUT)
    rms = float(np.sqrt(np.mean(off[heldout] ** 2))) / predictor.signal.factor
    assert fit["heldout"]["points"] == int(heldout.sum())
    assert fit["heldout"]["repaired"] == pytest.approx(rms, rel=0.02)
    assert fit["heldout"]["repaired"] < fit["heldout"]["recalibrated"]


VISCOUS = """
plant: viscous
title: Glycol through a mixer
fluid: meg-50
modules:
  P: {type: progressive-cavity}
  M: {type: magnetic-meter, reference: {Q: 3.5}}
  X: {type: mixer-by-factor}
connections: [P -> M, M -> X]
"""


def test_the_error_shown_is_that_of_a_reading_that_the_repair_moves(tmp_path: Path) -> None:
    """Relations tell the flow by the power, too; a simulation predicts the power instead."""
    (tmp_path / "plant.yaml").write_text(VISCOUS, encoding="utf-8")
    plant, samples = open_builder(tmp_path / "plant.yaml"), 240
    given = {**tour(plant[0], samples, dwell=12), "X.T": warming(samples)}
    friction = "P.friction-viscosity@P_rub(n, viscosity(X.T))"
    law = {"k": 0.5, "m": 1.0, "mu0": 3.0e-3, "n0": 5.0}
    found = compared(plant, recorded(plant, given, {friction: law}, moved=False))
    assert [friction] == [finding.id for finding in found.findings]
    assert ["P.P_el"] == [fit.signal for fit in found.fits]


def test_what_is_refused_is_not_written_but_recalibrated_values_are(
    folder: Path, capsys: Capsys
) -> None:
    said = refused(folder, capsys, lambda form: form["repair"].update(refused="worse than before"))
    assert "nothing written: worse than before" in said
    assert "--recalibrated" in said
    assert 0 == adopt(folder, "--recalibrated")
    assert "no equation was changed" in capsys.readouterr().out
    errors = simulated_errors(folder)
    for check in form_in(folder)["repair"]["checks"]:
        assert check["plain"] == pytest.approx(errors[check["signal"]], rel=1e-5)
    assert "A.T" not in compile_plant(folder / "new").observer_by_id["A.pump"].signals


@pytest.mark.parametrize("file", ["plant.yaml", "kb/own/pumps/pump.yaml", "run.csv"])
def test_what_has_changed_since_is_refused(folder: Path, capsys: Capsys, file: str) -> None:
    with (folder / file).open("a", encoding="utf-8") as changed:
        changed.write("\n")
    said = refused(folder, capsys)
    assert file.rpartition("/")[2] in said
    assert "since the analysis" in said


def test_what_cannot_be_tried_is_not_written(folder: Path, capsys: Capsys) -> None:
    def spoil(form: Form) -> None:
        place = form["repair"]["parameters"].index("A.C2")
        form["repair"]["values"][place] *= 1.2

    assert "in the analysis; run rulec mismatch again" in refused(folder, capsys, spoil)
    said = refused(folder, capsys, lambda form: form["repair"].pop("made_from"))
    assert "does not say which files" in said


NAN = float("nan")
THREE = np.array([0.0, 1.0, 2.0])
ZERO = 1.0
"""V by which the level reading is off: twenty times its class."""


def test_a_zero_beyond_its_class_does_not_flatter_the_shipped_plant() -> None:
    """Whoever simulates the plant meets the zero; the analysis may let it float."""
    clean = made(n=512, seed=4)
    off = np.clip(clean.values["lower.y"] + ZERO, 0.0, 10.0)
    recording = changed(clean, {"lower.y": off})
    problem, (rules, builder) = problem_of(recording), tanks()
    plain = plain_end(problem, {})
    said = explained(recording, plain, plain)
    proofs = said.proofs(())
    refits, shown = written(said, proofs)
    assert shown.plants is not None
    held = shown.fits[0].heldout
    spans = heldout_spans(problem.record.time, ~problem.record.open)
    repaired = trial(builder, refits.repairs[0])
    for ruleset, error in ((rules, held.shipped), (repaired, held.recalibrated)):
        found = row_errors(ruleset, simulated(ruleset, recording), recording, spans)
        assert found["lower.y"][0] == pytest.approx(error, rel=1e-9)
    (reading,) = said.readings(None, refits, proofs)
    course = course_of(rules.signal_by_id["lower.y"], reading.measured, reading.predicted)
    series = Series(problem.record.time, ~problem.record.open, (course,))
    table = columns(replace(NAMED, series=series))
    error = table["lower.y recalibrated [V]"] - table["lower.y measured [V]"]
    rms = np.sqrt(np.nanmean(error[table["heldout [1]"] == 1] ** 2))
    assert pytest.approx(reading.fit.heldout.recalibrated, rel=1e-4) == rms
    assert reading.fit.relation is None


def test_courses_of_a_very_long_recording_keep_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """With more rows than the square of the most samples, the rest has more than one row each."""
    monkeypatch.setattr(limits, "SAMPLE_BUDGET", 40)
    recording = made(n=40**2 - 1)
    plain = plain_end(problem_of(recording), {})
    said = explained(recording, plain, plain)
    _, shown = written(said, said.proofs(()))
    assert shown.plants is not None
    (course,) = shown.series.courses
    means = thinned(recording.time, {}, shown.plants.recalibrated, 40)[2]["lower.y"]
    assert course.recalibrated == pytest.approx(means, rel=1e-12)


def test_a_cell_without_value_is_empty() -> None:
    """Columns in the agreed order, each with its unit. Without a split there is a head."""
    own = {"measured": np.array([1.0, NAN, 3.0]), "repaired": np.array([NAN, 1, 2])}
    course = Course(signal="A.Q", unit="l/h", shipped=THREE, recalibrated=THREE, **own)
    table = series_csv(Series(THREE, np.array([False, True, False]), (course,)))
    assert [
        "time [s],heldout [1],A.Q measured [l/h],A.Q shipped [l/h],A.Q recalibrated [l/h],"
        "A.Q repaired [l/h]",
        "0,0,1,0,0,",
        "1,1,,1,1,1",
        "2,0,3,2,2,2",
    ] == table.splitlines()
    assert "time [s],heldout [1]\n" == series_csv(CANNOT_JUDGE.series)
    assert [] == mismatch_form(CANNOT_JUDGE, "x")["split"]["heldout"]


def test_a_range_grows_only_where_a_relation_was_tested() -> None:
    """Not where a meter shows nothing or all relations differ; a meter has no law and no range."""
    plant, name = open_builder(Path(__file__).parent / "oil.yaml"), "main.slip-temperature@Q_law"
    pressure = 1e5 * (124.0 + 43.0 * np.mod(np.arange(240) // 12 * 0.618, 1.0))
    given = {"main.dp": pressure, "main.T": warming(240)}
    recording = recorded(plant, given, moved=False)
    flow = np.where(given["main.T"] > 315.0, np.nan, recording.values["main.Q"])
    flow[pressure > 160e5] *= 0.7
    law = next(c for c in plant[1].candidates if c.id == name)
    setting = Configuration().joining(law, {f"{name}.b": 0.01}, {f"{name}.T0": USUAL})
    found = fitted(plant, changed(recording, {"main.Q": flow}), setting)
    ranges = repair_of(found, found.covariance).ranges
    assert {"main.dp", "main.P_el", "main.T"} == set(ranges)
    assert 155e5 < ranges["main.dp"][1] < 161e5
    assert 310.0 < ranges["main.T"][1] < 315.5
