"""The chain: compare, adopt, compile, simulate. The adopted plant is as good as was promised."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.recording import read_recording

from rulec.cli import main
from rulec.effects.model_builder import open_builder
from rulec.mismatch.evidence.samples import HELDOUT
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.predict import predictors_for
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.system import System
from rulec.passes.pipeline import compile_plant
from rulec.prove.truth import write_csv
from tests.conftest import ROOT
from tests.runtime.mismatch.made import USUAL, alone, recorded, tour, warming

SAMPLES = 240
TYPE = "dosing-pcp"

Form = dict[str, Any]


@pytest.fixture(scope="module")
def analysed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plant whose type lies deep in its own knowledge base, a recording, and the comparison."""
    place: Path = tmp_path_factory.mktemp("public")
    shutil.copytree(ROOT / "kb", place / "kb")
    deep = place / "kb" / "own" / "pumps"
    deep.mkdir(parents=True)
    (place / "kb" / "modules" / f"{TYPE}.yaml").rename(deep / "pump.yaml")
    shutil.copy(Path(__file__).parent / "plant.yaml", place / "plant.yaml")
    rules, _ = alone()
    given = {**tour(rules, SAMPLES), "A.T": warming(SAMPLES)}
    slip = {"A.slip-temperature@Q_geo": {"b": 0.1, "T0": USUAL}}
    recording = recorded(alone(), given, slip, seed=3)
    columns = {"time [s]": recording.time}
    for signal in rules.signals:
        if signal.id in recording.values:
            shown = (recording.values[signal.id] - signal.offset) / signal.factor
            columns[f"{signal.id} [{signal.unit}]"] = shown
    write_csv(place / "run.csv", columns, 9)
    found = place / "found.json"
    assert 0 == main(
        ["mismatch", str(place / "plant.yaml"), str(place / "run.csv"), "--json", str(found)]
    )
    return place


def copied(analysed: Path, place: Path) -> Path:
    """All of it again; the machine form speaks of these files."""
    shutil.copytree(analysed, place)
    file = place / "found.json"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace(analysed.as_posix(), place.as_posix()), encoding="utf-8")
    return place


@pytest.fixture
def folder(analysed: Path, tmp_path: Path) -> Path:
    """Where a test may change it."""
    return copied(analysed, tmp_path / "work")


def adopt(folder: Path, *options: str) -> int:
    return main(["adopt", str(folder / "found.json"), "-o", str(folder / "new"), *options])


def rewritten(folder: Path, change: Callable[[Form], object]) -> None:
    """Change the machine form."""
    file = folder / "found.json"
    form = json.loads(file.read_text(encoding="utf-8"))
    change(form)
    file.write_text(json.dumps(form), encoding="utf-8")


def simulated_error(folder: Path, plant: Path, signal: str) -> float:
    """Error over all held-out rows, by the commands alone."""
    form = json.loads((folder / "found.json").read_text(encoding="utf-8"))
    run, target = folder / "run.csv", folder / "simulated.csv"
    assert 0 == main(["simulate", str(plant), str(run), "-o", str(target)])
    rules = compile_plant(plant)
    measured, predicted = read_recording(run, rules), read_recording(target, rules)
    time = measured.time
    inside = np.any([(time >= a) & (time <= b) for a, b in form["split"]["heldout"]], axis=0)
    off = (predicted.values[signal] - measured.values[signal])[inside]
    return float(np.sqrt(np.nanmean(off**2))) / rules.signal_by_id[signal].factor


@pytest.mark.parametrize(("options", "key"), [((), "error"), (("--recalibrated",), "plain")])
def test_told_is_what_the_written_plant_gives(
    folder: Path, options: tuple[str, ...], key: str
) -> None:
    """For the repaired and for the recalibrated plant; the repaired one is better."""
    form = json.loads((folder / "found.json").read_text(encoding="utf-8"))
    assert 0 == adopt(folder, *options)
    checks = form["repair"]["checks"]
    assert checks
    for check in checks:
        error = simulated_error(folder, folder / "new", check["signal"])
        assert check[key] == pytest.approx(error, rel=1e-5)
    held = form["fit"]["heldout"]
    assert held["repaired"] < held["recalibrated"]
    kind = compile_plant(folder / "new").observer_by_id["A.pump"]
    assert (key == "error") == ("A.T" in kind.signals)


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("plant.yaml", "# new\n"),
        ("kb/own/pumps/pump.yaml", "# new\n"),
        ("kb/sensors/piezoresistive.yaml", "# new\n"),
        ("run.csv", "\n"),
    ],
)
def test_what_has_changed_since_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], file: str, text: str
) -> None:
    """Which file is said, and nothing is written."""
    with (folder / file).open("a", encoding="utf-8") as changed:
        changed.write(text)
    assert 1 == adopt(folder)
    said = " ".join(capsys.readouterr().err.split())
    assert file.rpartition("/")[2] in said
    assert "since the analysis" in said
    assert not (folder / "new").exists()


def test_a_recording_that_is_gone_is_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is adopted is tried on it."""
    (folder / "run.csv").unlink()
    assert 1 == adopt(folder)
    assert "is not there any more" in " ".join(capsys.readouterr().err.split())


def test_what_does_not_do_what_was_told_is_not_written(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No half-written folder stays behind either."""
    before = sorted(folder.iterdir())

    def spoil(form: Form) -> None:
        place = form["repair"]["parameters"].index("A.C2")
        form["repair"]["values"][place] *= 1.2

    rewritten(folder, spoil)
    assert 1 == adopt(folder)
    assert "was found in the analysis" in " ".join(capsys.readouterr().err.split())
    assert before == sorted(folder.iterdir())


def test_what_is_refused_is_not_written_but_recalibrated_values_are(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The reason is said, and the way out."""
    rewritten(folder, lambda form: form["repair"].update(refused="worse than before"))
    assert 1 == adopt(folder)
    said = " ".join(capsys.readouterr().err.split())
    assert "nothing is written: worse than before" in said
    assert "--recalibrated" in said
    assert 0 == adopt(folder, "--recalibrated")
    assert "no equation was changed" in capsys.readouterr().out


def test_a_form_without_its_origin_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Such as one of an earlier version."""
    rewritten(folder, lambda form: form["repair"].pop("made_from"))
    assert 1 == adopt(folder)
    assert "does not say which files" in " ".join(capsys.readouterr().err.split())


@pytest.fixture(scope="module")
def adopted(analysed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With the plant that was adopted in `new`."""
    place = copied(analysed, tmp_path_factory.mktemp("adopted") / "work")
    assert 0 == adopt(place)
    return place


def found(folder: Path) -> Form:
    form: Form = json.loads((folder / "found.json").read_text(encoding="utf-8"))
    return form


def test_the_effect_is_in_the_new_plant(adopted: Path) -> None:
    """It compiles, and its pump law reads the temperature."""
    rules = compile_plant(adopted / "new")
    assert ["slip-temperature"] == [e["effect"] for e in found(adopted)["effects"]]
    assert "A.T" in rules.observer_by_id["A.pump"].signals


def test_held_out_errors_are_as_promised(adopted: Path) -> None:
    """The adopted plant, as it compiles, misses held-out points by what was told, to 2 %."""
    rules, builder = open_builder(adopted / "new")
    # The points of the old plant: the new one wants the temperature settled as well.
    data = prepare(read_recording(adopted / "run.csv", rules), alone()[0])
    assert data is not None
    system = System(rules, builder, data)
    told = found(adopted)["fit"]
    own = predictors_for(system, ("A.pump", "A.power"), frozenset({"A.dp", "A.T"}))
    predictor = next(p for p in own if p.signal.id == told["signal"])
    off = data.values[predictor.signal.id] - predictor.predicted(Configuration())
    kept = predictor.points & (data.part == HELDOUT)
    rms = float(np.sqrt(np.mean(off[kept] ** 2))) / predictor.signal.factor
    assert told["heldout"]["points"] == int(kept.sum())
    assert told["heldout"]["repaired"] == pytest.approx(rms, rel=0.02)


def simulated(folder: Path, plant: str, name: str) -> Array:
    """Errors of the simulation of a plant on the inputs of the recording, at settled points."""
    out = folder / f"{name}.csv"
    assert 0 == main(["simulate", str(folder / plant), str(folder / "run.csv"), "-o", str(out)])
    rules = compile_plant(folder / plant)
    points = [prepare(read_recording(f, rules), rules) for f in (folder / "run.csv", out)]
    measured, predicted = (p.values["A.P_el"] for p in points if p is not None)
    return np.asarray(measured - predicted)


def test_the_new_plant_simulates_better(adopted: Path) -> None:
    """From the speed and the temperature alone, the power is met better than by the old plant."""
    old, new = simulated(adopted, "plant.yaml", "old"), simulated(adopted, "new", "renewed")
    assert float(np.sqrt(np.mean(new**2))) < 0.6 * float(np.sqrt(np.mean(old**2)))
