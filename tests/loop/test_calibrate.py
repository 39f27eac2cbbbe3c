"""Calibration by the whole equation of a flow meter, and what it says of a poor recording."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from rulec.cli import main
from tests.loop import rig


def _calibrate(folder: Path, recording: Path) -> dict[str, Any]:
    target = folder / "found.json"
    arguments = ["calibrate", str(folder), str(recording), "-o", str(folder / "found.yaml")]
    assert 0 == main([*arguments, "--json", str(target)])
    found: dict[str, Any] = json.loads(target.read_text(encoding="utf-8"))
    return found


def test_the_flow_is_what_the_equation_of_the_meter_says(tmp_path: Path) -> None:
    """Milliamperes are no flow: the truth comes back within its uncertainty."""
    folder = rig.plant(tmp_path)
    found = _calibrate(folder, rig.run_in(folder))
    parameters = found["modules"]["A"]["parameters"]
    for name, value in (("V", rig.V), ("C", rig.C), ("b", rig.b), ("k2", rig.K2)):
        assert abs(parameters[name]["value"] - value) < 3.0 * parameters[name]["u"]
    assert parameters["V"]["value"] == pytest.approx(rig.V, rel=0.01)
    assert set(parameters) == {"V", "C", "b", "k2"}
    assert found["notes"] == []


def test_what_the_meter_may_be_off_is_in_the_uncertainty(tmp_path: Path) -> None:
    """A gain of the loop known to 2 % makes no displacement known to better than that."""
    folder = rig.plant(tmp_path)
    sharp = _calibrate(folder, rig.run_in(folder))["modules"]["A"]["parameters"]
    kind = folder / "kb" / "modules" / "warm-loop.yaml"
    text = kind.read_text(encoding="utf-8")
    kind.write_text(text.replace("unit: l/h/mA, u: 0.1", "unit: l/h/mA, u: 1.25"), encoding="utf-8")
    blunt = _calibrate(folder, folder / "run-in.csv")["modules"]["A"]["parameters"]
    assert blunt["k2"]["u"] > 3.0 * sharp["k2"]["u"]
    assert blunt["k2"]["u"] / blunt["k2"]["value"] == pytest.approx(2 * 0.02, rel=0.2)


def test_a_value_of_another_size_than_the_data_sheet_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A sheet without an uncertainty says 6e-7 bar/(l/h)**2 where the line has 7.3e-6."""
    stated = "{k2: {value: 6e-7, unit: bar/(l/h)**2, u: 0, source: other pump}}"
    folder = rig.plant(tmp_path)
    text = (folder / "plant.yaml").read_text(encoding="utf-8")
    text = text.replace("{type: warm-loop}", f"{{type: warm-loop, parameters: {stated}}}")
    (folder / "plant.yaml").write_text(text, encoding="utf-8")
    notes = _calibrate(folder, rig.run_in(folder))["notes"]
    told = [note for note in notes if note.startswith("A.k2: the recording says")]
    assert 1 == len(told)
    assert "the data sheet 6e-07 bar/(l/h)**2; check the units" in told[0]
    assert told[0] in capsys.readouterr().out


def test_a_reading_that_stood_is_told_and_gets_the_bounds_of_its_sensor(tmp_path: Path) -> None:
    """No range "40 to 40 degC" that every later sample leaves."""
    folder = rig.plant(tmp_path)
    found = _calibrate(folder, rig.run_in(folder, varied=False))
    told = [note for note in found["notes"] if note.startswith("A.T stood all the time")]
    assert 1 == len(told)
    written = yaml.safe_load((folder / "found.yaml").read_text(encoding="utf-8"))
    entry = written["modules"]["A"]["range"]["T"]
    sensor = yaml.safe_load((folder / "kb/sensors/industrial-thermometer.yaml").read_text("utf-8"))
    bound = 2.0 * sensor["systematic"]["bound"] / sensor["coverage"]
    assert [entry["from"], entry["to"]] == pytest.approx([40 - bound, 40 + bound], abs=0.02)
    assert "its sensor" in entry["source"]
    assert "source" not in written["modules"]["A"]["range"]["n"]
    (folder / "plant.yaml").open("a", encoding="utf-8").write("calibration: [found.yaml]\n")
    assert 0 == main(["check", str(folder)])


def test_a_column_map_converts_back_and_forth(tmp_path: Path) -> None:
    """Raw counts under a map mean what the readings do, and `simulate` writes counts again."""
    folder = rig.plant(tmp_path, "columns: columns.yaml\n")
    counts = "{from: adc, unit: mA, scale: 0.005, offset: 4}"
    (folder / "columns.yaml").write_text(f"columns:\n  A.I_Q: {counts}\n", encoding="utf-8")
    speed, T = np.linspace(500.0, 1400.0, 30), 20.0 + 5.0 * (7 * np.arange(30) % 10)
    plain = rig.readings(speed, T)
    raw = {k: v for k, v in plain.items() if "I_Q" not in k}
    raw["adc"] = (plain["A.I_Q [mA]"] - 4.0) / 0.005
    recording = rig.write(folder / "raw.csv", raw)
    found = _calibrate(folder, recording)["modules"]["A"]["parameters"]
    assert found["V"]["value"] == pytest.approx(rig.V, rel=0.01)
    (folder / "plant.yaml").open("a", encoding="utf-8").write("calibration: [found.yaml]\n")
    target = folder / "made.csv"
    assert 0 == main(["simulate", str(folder), str(recording), "-o", str(target)])
    made = np.genfromtxt(target, delimiter=",", names=True)
    np.testing.assert_allclose(made["adc"], raw["adc"], atol=5.0)
