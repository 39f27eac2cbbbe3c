"""Calibration finds the parameters of the independent truth, and says when it cannot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from rulec.cli import main
from rulec.prove.truth import NOISE_FREE, abc, calibration_run, record, write_csv
from tests.conftest import ROOT

TRUTH = {"C0": 6.0, "C2": 2.0, "P0": 25.0, "P1": 0.095, "eta": 0.70, "k0": 0.05, "k2": 5.2e-6}
"""Parameters of the truth's dosing module, docs of rulec/prove/truth, in the units of the kb."""


def _calibrate(recording: Path, folder: Path) -> dict[str, Any]:
    target = folder / "found.json"
    arguments = ["calibrate", str(ROOT / "plants" / "abc"), str(recording)]
    assert main([*arguments, "-o", str(folder / "found.yaml"), "--json", str(target)]) == 0
    found: dict[str, Any] = json.loads(target.read_text(encoding="utf-8"))["modules"]
    return found


def test_noise_free_calibration_is_exact(tmp_path: Path) -> None:
    """Without noise every parameter comes back to 0.1 %."""
    recording = tmp_path / "recording.csv"
    write_csv(recording, record(calibration_run(abc()), NOISE_FREE).readings, digits=12)
    found = _calibrate(recording, tmp_path)
    for name, value in TRUTH.items():
        assert found["A"]["parameters"][name]["value"] == pytest.approx(value, rel=1e-3)


def test_calibration_covers_the_truth(tmp_path: Path) -> None:
    """With noise and systematic errors, over five makers, nearly all parameters are within 3 u."""
    distances = []
    for seed in range(11, 16):
        recording = tmp_path / f"{seed}.csv"
        write_csv(recording, record(calibration_run(abc()), seed=seed).readings)
        found = _calibrate(recording, tmp_path)
        for module in "AB":
            for name, value in TRUTH.items():
                entry = found[module]["parameters"][name]
                distances.append(abs(entry["value"] - value) / entry["u"])
    assert np.mean(np.array(distances) < 3.0) > 0.95
    assert 0.2 < np.sqrt(np.mean(np.square(distances))) < 1.5


def test_calibrated_plant_compiles_and_finds_the_leak(tmp_path: Path) -> None:
    """The file can be named in plant.yaml; the diagnosis then rests on it."""
    _calibrate(ROOT / "plants" / "abc" / "examples" / "calibration.csv", tmp_path)
    text = (ROOT / "plants" / "abc" / "plant.yaml").read_text(encoding="utf-8")
    text += f"calibration: [found.yaml]\nkb: {ROOT / 'kb'}\n"
    (tmp_path / "plant.yaml").write_text(text, encoding="utf-8")
    recording = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"
    target = tmp_path / "diagnosis.json"
    assert main(["diagnose", str(tmp_path), str(recording), "--json", str(target)]) == 0
    findings = json.loads(target.read_text(encoding="utf-8"))["findings"]
    assert ["A.leakage"] * 3 == [f["fault"] for f in findings]
    assert [0.2, 0.4, 0.6] == pytest.approx([f["degree"] for f in findings], abs=0.02)


def test_shipped_calibration_is_what_the_command_makes(tmp_path: Path) -> None:
    """The rig's parameters come from its recording, not from the truth."""
    plant = ROOT / "plants" / "mixing-rig"
    target = tmp_path / "found.yaml"
    recording = plant / "examples" / "calibration.csv"
    assert main(["calibrate", str(plant), str(recording), "-o", str(target)]) == 0
    shipped, found = (
        yaml.safe_load(path.read_text(encoding="utf-8"))["modules"]
        for path in (plant / "calibration.yaml", target)
    )
    assert list(shipped) == list(found)
    for module, entry in found.items():
        for name, parameter in entry["parameters"].items():
            expected = shipped[module]["parameters"][name]
            assert expected["u"] == pytest.approx(parameter["u"], rel=1e-3)
            assert expected["value"] == pytest.approx(parameter["value"], abs=1e-3 * parameter["u"])


def _stated(folder: Path, parameters: str) -> Path:
    """The plant with other numbers in the data sheet of A."""
    text = (ROOT / "plants" / "abc" / "plant.yaml").read_text(encoding="utf-8")
    plain = "A: {type: dosing-pcp"
    assert plain in text
    text = text.replace(plain, f"{plain}, parameters: {parameters}", 1)
    (folder / "plant.yaml").write_text(f"{text}kb: {ROOT / 'kb'}\n", encoding="utf-8")
    return folder


def test_what_was_known_before_stays_known(tmp_path: Path) -> None:
    """No parameter is less certain than its data sheet, and most are more certain."""
    write_csv(tmp_path / "r.csv", record(calibration_run(abc()), seed=11).readings)
    found = _calibrate(tmp_path / "r.csv", tmp_path)["A"]["parameters"]
    kind = yaml.safe_load((ROOT / "kb/modules/dosing-pcp.yaml").read_text(encoding="utf-8"))
    stated = {name: kind["parameters"][name]["u"] for name in TRUTH}
    assert all(found[name]["u"] <= 1.001 * u for name, u in stated.items())
    assert 4 <= sum(found[name]["u"] < 0.8 * u for name, u in stated.items())


def test_a_data_sheet_that_the_recording_contradicts_is_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The recording then says all, and the note names the observer."""
    stated = "{C2: {value: 3.0, unit: l/h/bar**2, u: 0.01, source: test}}"
    plant = _stated(tmp_path, stated)
    write_csv(tmp_path / "r.csv", record(calibration_run(abc()), NOISE_FREE).readings, digits=12)
    arguments = ["calibrate", str(plant), str(tmp_path / "r.csv")]
    assert 0 == main([*arguments, "-o", str(tmp_path / "f.yaml")])
    assert "A.pump: the recording contradicts the data sheet" in capsys.readouterr().out
    found = yaml.safe_load((tmp_path / "f.yaml").read_text(encoding="utf-8"))["modules"]
    for name, value in TRUTH.items():
        assert found["A"]["parameters"][name]["value"] == pytest.approx(value, rel=1e-3)


def test_a_data_sheet_without_uncertainty_says_nothing(tmp_path: Path) -> None:
    """A wrong value that claims nothing does no harm."""
    plant = _stated(tmp_path, "{C2: {value: 3.0, unit: l/h/bar**2, u: 0, source: test}}")
    write_csv(tmp_path / "r.csv", record(calibration_run(abc()), NOISE_FREE).readings, digits=12)
    assert 0 == main(["calibrate", str(plant), str(tmp_path / "r.csv"), "-o", f"{tmp_path}/f.yaml"])
    found = yaml.safe_load((tmp_path / "f.yaml").read_text(encoding="utf-8"))["modules"]
    assert found["A"]["parameters"]["C2"]["value"] == pytest.approx(2.0, rel=1e-3)


def test_the_error_of_a_bench_meter_is_no_misfit(tmp_path: Path) -> None:
    """A power meter 10 W high, its bound, where a data sheet knows the power at rest to 0.5 W: all
    points lie beside the law, none scatters about it."""
    readings = record(calibration_run(abc()), NOISE_FREE).readings
    readings = {**readings, "A.P_el [W]": readings["A.P_el [W]"] + 10.0}
    write_csv(tmp_path / "r.csv", readings, digits=12)
    misfit = _calibrate(tmp_path / "r.csv", tmp_path)["A"]["misfit"]
    assert 0.5 > misfit["power"]["value"]


def test_the_noise_of_readings_is_no_misfit(tmp_path: Path) -> None:
    """Laws that hold have no misfit, however the readings scatter; one that does not, its own."""
    run = calibration_run(abc())
    own, bent = [], []
    for seed in range(21, 29):
        readings = record(run, seed=seed).readings
        write_csv(tmp_path / "r.csv", readings)
        own.append(_calibrate(tmp_path / "r.csv", tmp_path)["A"]["misfit"]["pump"]["value"])
        share = 1.0 + 0.02 * np.sin(readings["A.n [rpm]"] / 20.0)
        write_csv(tmp_path / "r.csv", {**readings, "A.Q [l/h]": readings["A.Q [l/h]"] * share})
        bent.append(_calibrate(tmp_path / "r.csv", tmp_path)["A"]["misfit"]["pump"]["value"])
    assert np.median(own) < 0.15
    assert 1.0 < np.median(bent)


def test_points_off_the_law_are_set_aside(tmp_path: Path) -> None:
    """A tenth of the points with a wrong flow does not bend the fit."""
    readings = record(calibration_run(abc()), NOISE_FREE).readings
    flow = readings["A.Q [l/h]"].copy()
    flow[:30] *= 0.6
    write_csv(tmp_path / "r.csv", {**readings, "A.Q [l/h]": flow}, digits=12)
    found = _calibrate(tmp_path / "r.csv", tmp_path)
    assert 3 == found["A"]["misfit"]["pump"]["set_aside"]
    assert found["A"]["parameters"]["C2"]["value"] == pytest.approx(2.0, rel=1e-2)


def test_a_module_that_stood_keeps_its_values(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where one of several pumps never ran, the others are calibrated, and this one is named."""
    text = (ROOT / "plants" / "abc" / "plant.yaml").read_text(encoding="utf-8")
    text = text.replace("connections:\n  - A -> C\n  - B -> C\n", "").replace(
        "static-mixer", "pump-set"
    )
    (tmp_path / "plant.yaml").write_text(f"{text}kb: {ROOT / 'kb'}\n", encoding="utf-8")
    readings = dict(record(calibration_run(abc()), NOISE_FREE).readings)
    readings["C.Q [l/min]"] = np.zeros(len(readings["A.Q [l/h]"]))
    write_csv(tmp_path / "r.csv", readings, digits=12)
    target = tmp_path / "found.json"
    arguments = ["calibrate", str(tmp_path), str(tmp_path / "r.csv")]
    assert 0 == main([*arguments, "-o", str(tmp_path / "f.yaml"), "--json", str(target)])
    assert "left as they were: C\n" in capsys.readouterr().out
    assert {"A", "B"} == set(json.loads(target.read_text(encoding="utf-8"))["modules"])


def test_a_recording_that_cannot_calibrate_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One operating point determines nothing: the message names the parameters, no file appears."""
    arguments = ["calibrate", str(ROOT / "plants" / "abc")]
    recording = ROOT / "plants" / "abc" / "examples" / "healthy.csv"
    assert main([*arguments, str(recording), "-o", str(tmp_path / "no.yaml")]) == 1
    assert "settled points" in capsys.readouterr().err
    assert not (tmp_path / "no.yaml").exists()
