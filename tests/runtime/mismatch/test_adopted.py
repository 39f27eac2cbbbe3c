"""The chain: compare, adopt, compile, simulate. The adopted plant is as good as was promised."""

from __future__ import annotations

import json
import shutil
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
from tests.runtime.mismatch.made import USUAL, alone, recorded, tour, warming

SAMPLES = 240


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plant, a recording of it, what the comparison found, and the plant that was adopted."""
    place: Path = tmp_path_factory.mktemp("adopted")
    shutil.copy(Path(__file__).parent / "plant.yaml", place / "plant.yaml")
    rules, _ = alone()
    given = {**tour(rules, SAMPLES), "A.T": warming(SAMPLES)}
    recording = recorded(
        alone(), given, {"A.slip-temperature@Q_geo": {"b": 0.04, "T0": USUAL}}, seed=3
    )
    columns = {"time [s]": recording.time}
    for signal in rules.signals:
        if signal.id in recording.values:
            shown = (recording.values[signal.id] - signal.offset) / signal.factor
            columns[f"{signal.id} [{signal.unit}]"] = shown
    write_csv(place / "run.csv", columns, 9)
    paths = (place / name for name in ("plant.yaml", "run.csv", "found.json", "new"))
    plant, run, found, new = map(str, paths)
    assert 0 == main(["mismatch", plant, run, "--json", found])
    assert 0 == main(["adopt", found, "-o", new])
    return place


def found(folder: Path) -> dict[str, Any]:
    form: dict[str, Any] = json.loads((folder / "found.json").read_text(encoding="utf-8"))
    return form


def test_the_effect_is_in_the_new_plant(folder: Path) -> None:
    """It compiles, and its pump law reads the temperature."""
    rules = compile_plant(folder / "new")
    assert ["slip-temperature"] == [e["effect"] for e in found(folder)["effects"]]
    assert "A.T" in rules.observer_by_id["A.pump"].signals


def test_held_out_errors_are_as_promised(folder: Path) -> None:
    """The adopted plant, as it compiles, misses held-out points by what was told, to 2 %."""
    rules, builder = open_builder(folder / "new")
    # The points of the old plant: the new one wants the temperature settled as well.
    data = prepare(read_recording(folder / "run.csv", rules), alone()[0])
    assert data is not None
    system = System(rules, builder, data)
    told = found(folder)["fit"]
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


def test_the_new_plant_simulates_better(folder: Path) -> None:
    """From the speed and the temperature alone, the power is met better than by the old plant."""
    old, new = simulated(folder, "plant.yaml", "old"), simulated(folder, "new", "renewed")
    assert float(np.sqrt(np.mean(new**2))) < 0.6 * float(np.sqrt(np.mean(old**2)))
