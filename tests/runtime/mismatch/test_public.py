"""What is told of a model is what anybody finds who simulates the plant that was written."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rulec_runtime.recordings.recording import read_recording

from rulec.cli import main
from rulec.effects.adopted_plant import trial
from rulec.mismatch.answer.public import row_errors, simulated
from rulec.mismatch.answer.writable import told, writable
from rulec.mismatch.evidence.steady.settle import _ranges
from rulec.mismatch.evidence.stores.drift import no_drift
from rulec.mismatch.evidence.stores.fit import Judged
from rulec.mismatch.evidence.stores.model import model_of
from rulec.mismatch.inference.series import heldout_spans
from rulec.mismatch.search.stores.search import Found
from rulec.mismatch.search.stores.searcher import Searcher
from rulec.mismatch.stores import explanation
from rulec.passes.pipeline import compile_plant
from rulec.prove.truth import write_csv
from tests.conftest import ROOT
from tests.runtime.mismatch.dynamic.benches import bench, made, tanks
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
    slip = {"A.slip-temperature@Q_geo": {"b": 0.04, "T0": USUAL}}
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


@pytest.fixture
def folder(analysed: Path, tmp_path: Path) -> Path:
    """All of it again, where a test may change it; the machine form speaks of these files."""
    place = tmp_path / "work"
    shutil.copytree(analysed, place)
    file = place / "found.json"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace(analysed.as_posix(), place.as_posix()), encoding="utf-8")
    return place


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


ZERO = 1.0
"""V by which the level reading is off: twenty times its class."""


def test_a_zero_beyond_its_class_does_not_flatter_the_shipped_plant() -> None:
    """Whoever simulates the plant meets the zero; the analysis may let it float."""
    clean = made(n=512, seed=4)
    off = np.clip(clean.values["lower.y"] + ZERO, 0.0, 10.0)
    recording = replace(clean, values={**clean.values, "lower.y": off})
    place, (rules, builder) = bench(recording), tanks()
    searcher = Searcher(place, Judged(place.known, {}, no_drift(place), np.zeros(0)), 1)
    plain = searcher.plain()
    explained = explanation(
        recording,
        model_of(place, plain, searcher.judged, {}),
        Found(plain, plain, searcher.judged, 0, {}),
    )
    refits = writable(explained)
    shown = told(explained, refits, explained.proofs(()))
    assert shown.plants is not None
    held = shown.fits[0].heldout
    spans = heldout_spans(place.record.time, ~place.record.open)
    for ruleset, error in (
        (rules, held.shipped),
        (trial(builder, refits.repairs[0]), held.recalibrated),
    ):
        found = row_errors(ruleset, simulated(ruleset, recording), recording, spans)
        assert found["lower.y"][0] == pytest.approx(error, rel=1e-9)


def test_a_range_grows_only_where_a_relation_was_tested() -> None:
    """Behind a closed valve a flow meter shows nothing: no relation judges the pump there."""
    dp = np.array([100.0, 120.0, 140.0, 160.0, 190.0])
    flows = np.array([[9.0, 8.8, 8.6, 8.4, 8.1], [9.0, 8.8, 8.6, 8.4, 0.0], [9, 8.8, 8.6, 8.4, 5]])
    valid = np.array([[True] * 5, [True, True, True, True, False], [True] * 5])
    names = ("m.pump", "m.flow", "m.power")
    observers = [
        SimpleNamespace(id="m.pump", module="m", signals=("m.dp",)),
        SimpleNamespace(id="m.flow", module="m", signals=("m.Q",)),
        SimpleNamespace(id="m.power", module="m", signals=("m.dp", "m.P")),
    ]

    def relation(*ids: str) -> SimpleNamespace:
        terms = [SimpleNamespace(observer=o, sign=s) for o, s in zip(ids, (1.0, -1.0), strict=True)]
        return SimpleNamespace(terms=terms)

    system = SimpleNamespace(
        ruleset=SimpleNamespace(
            residuals=[relation("m.pump", "m.flow"), relation("m.power", "m.pump")]
        ),
        number={n: i for i, n in enumerate(names)},
        flows=lambda setting: SimpleNamespace(values=flows),
        valid=valid,
        observers=observers,
        data=SimpleNamespace(values={"m.dp": dp, "m.T": dp + 1.0, "m.x": dp}),
    )
    law = SimpleNamespace(module="m", drivers={"T": "m.T"})
    plan = SimpleNamespace(
        select=lambda names: SimpleNamespace(used_inputs=() if "q:m.flow" in names else ("m.C",))
    )
    system.builder = SimpleNamespace(plan=lambda module, joined: plan)
    system.data.values["m.Q"] = dp + 2.0
    system.ruleset.signal_by_id = dict.fromkeys(system.data.values)
    settled: Any = SimpleNamespace(
        rows=SimpleNamespace(system=system),
        setting=SimpleNamespace(joined=[law], ids=("law",)),
        prior=SimpleNamespace(names=("m.C",)),
        used=np.ones(5, dtype=bool),
    )
    assert {"m.dp": (100.0, 160.0), "m.T": (101.0, 161.0)} == _ranges(settled)
