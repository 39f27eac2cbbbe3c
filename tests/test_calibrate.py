"""Calibration finds the parameters of the independent truth, and says when it cannot."""

import itertools
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from rich.console import Console

import rulec
from rulec.calibration.fit import CalibrationRefused
from rulec.calibration.law import own_misfit
from rulec.calibration.sheet_priors import SheetPriors
from rulec.cli import main
from tests.conftest import ROOT, Capsys
from tests.dosing import NOISE_FREE, RIGS, calibration_run, record, write_csv
from tests.written import json_of, write_plant

ABC = ROOT / "plants" / "abc"
TRUTH = {"C0": 6.0, "C2": 2.0, "P0": 25.0, "P1": 0.095, "eta": 0.70, "k0": 0.05, "k2": 5.2e-6}
"""Parameters of the truth's dosing module, docs of rulec/prove/truth, in the units of the kb."""


def _noise_free(folder: Path, change: Callable[[Any], dict[str, Any]] = dict) -> Path:
    """The run for calibration without sensor errors, changed."""
    readings = change(record(calibration_run(RIGS["abc"]), NOISE_FREE).readings)
    write_csv(folder / "r.csv", readings, digits=12)
    return folder / "r.csv"


def _calibrate(recording: Path, folder: Path, plant: Path = ABC) -> dict[str, Any]:
    return dict(json_of("calibrate", plant, recording, "-o", folder / "found.yaml")["modules"])


def test_noise_free_calibration_is_exact(tmp_path: Path) -> None:
    """Without noise every parameter comes back to 0.1 %; a value of the sheet that is wrong and
    claims nothing does no harm."""
    found = _calibrate(_noise_free(tmp_path), tmp_path)
    for name, value in TRUTH.items():
        assert found["A"]["parameters"][name]["value"] == pytest.approx(value, rel=1e-3)
    plant = _stated(tmp_path, "{C2: {value: 3.0, unit: l/h/bar**2, u: 0, source: test}}")
    found = _calibrate(tmp_path / "r.csv", tmp_path, plant)
    assert found["A"]["parameters"]["C2"]["value"] == pytest.approx(2.0, rel=1e-3)


def test_calibration_covers_the_truth(tmp_path: Path) -> None:
    """With noise and systematic errors, over three makers, nearly all parameters are within 3 u. Of
    the first none is less certain than its data sheet, most are more certain."""
    kind = yaml.safe_load((ROOT / "kb/modules/dosing-pcp.yaml").read_text(encoding="utf-8"))
    distances, sharper = [], []
    for seed in range(11, 14):
        write_csv(tmp_path / "r.csv", record(calibration_run(RIGS["abc"]), seed=seed).readings)
        found = _calibrate(tmp_path / "r.csv", tmp_path)
        for module, (name, value) in itertools.product("AB", TRUTH.items()):
            entry = found[module]["parameters"][name]
            distances.append(abs(entry["value"] - value) / entry["u"])
            if (seed, module) == (11, "A"):
                sharper.append(entry["u"] / kind["parameters"][name]["u"])
    assert np.mean(np.array(distances) < 3.0) > 0.95
    assert 0.2 < np.sqrt(np.mean(np.square(distances))) < 1.5
    assert max(sharper) <= 1.001
    assert 4 <= sum(share < 0.8 for share in sharper)


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
    text = (ABC / "plant.yaml").read_text(encoding="utf-8").partition("calibration:")[0]
    plain = "A: {type: dosing-pcp"
    assert plain in text
    text = text.replace(plain, f"{plain}, parameters: {parameters}", 1)
    (folder / "plant.yaml").write_text(f"{text}kb: {ROOT / 'kb'}\n", encoding="utf-8")
    return folder


def test_what_is_not_believed_is_written_by_force_alone(tmp_path: Path, capsys: Capsys) -> None:
    """A sheet 10 u off: what strains is told, and how to go on; never a tick."""
    plant = _stated(tmp_path, "{C2: {value: 3.0, unit: l/h/bar**2, u: 0.1, source: test}}")
    target = tmp_path / "f.yaml"
    arguments = ["calibrate", str(plant), str(_noise_free(tmp_path)), "-o", str(target)]
    (strain,) = json_of(*arguments, code=1)["strain"]
    assert not target.exists()
    assert ("A.C2", 3.0, 0.1) == (strain["parameter"], strain["stated"], strain["u"])
    assert strain["distance"] == pytest.approx(10.0, rel=0.01)
    assert 0 == main([*arguments, "--force"])
    found = yaml.safe_load(target.read_text(encoding="utf-8"))["modules"]["A"]["parameters"]
    assert found["C2"]["value"] == pytest.approx(TRUTH["C2"], rel=1e-3)
    output = capsys.readouterr().out
    assert "A.C2 2 l/h/bar**2, sheet 3 ± 0.1: 10.0 u" in output
    assert "rulec mismatch" in output
    assert "\N{CHECK MARK}" not in output
    with pytest.raises(CalibrationRefused, match=r"A\.C2"):
        rulec.calibrate(plant, tmp_path / "r.csv").write(target)


SHEET = {
    "h0": (1.111, 0.055, "bar"),
    "h1": (1.142e-4, 1.2e-5, "bar/(l/h)"),
    "h2": (3.04e-7, 3e-8, "bar/(l/h)**2"),
}
"""Value and standard uncertainty of a pump's head by its data sheet."""


def _pump(folder: Path, h0: float) -> Path:
    stated = ", ".join(
        f"{name}: {{value: {h0 if name == 'h0' else value}, u: {u}, unit: {unit}, source: test}}"
        for name, (value, u, unit) in SHEET.items()
    )
    return write_plant(folder, {"A": f"metered-centrifugal, parameters: {{{stated}}}"})


def test_one_operating_point_leaves_the_rest_to_the_sheet(tmp_path: Path, capsys: Capsys) -> None:
    """A pump that runs at one point only, or stands: no noise of a reading bends its curve."""
    speed = np.tile(np.repeat([2650.0, 0.0], [30, 6]), 20)
    given = {"time [s]": np.arange(len(speed)), "A.n [rpm]": speed, "A.T [degC]": 20.0 + 0 * speed}
    given |= {"A.Q [l/h]": np.where(speed > 0, 700.0, 0.0), "A.p_s [bar]": 0 * speed}
    made = rulec.simulate(_pump(tmp_path / "true", 1.141), given, noise=2).prediction.values
    noise = np.random.default_rng(102).standard_normal((2, len(speed))) * (speed > 0)
    given["A.n [rpm]"] = speed + 2.0 * noise[0]
    given["A.Q [l/h]"] = given["A.Q [l/h]"] + 5.0 * noise[1]
    given |= {"A.dp [bar]": made["A.dp"] / 1e5, "A.P_el [W]": made["A.P_el"]}
    found = rulec.calibrate(_pump(tmp_path / "sheet", 1.111), given)
    form = found.to_dict()
    parameters = form["modules"]["A"]["parameters"]
    for name, (value, u, _) in SHEET.items():
        assert abs(parameters[name]["value"] - value) < 2.0 * u
    assert abs(parameters["h0"]["value"] - 1.141) < 2.0 * parameters["h0"]["u"] < 0.05
    assert {"A.h1", "A.h2"} <= set(form["untold"])
    assert "A.h0" in form["moved"]
    found.tell(Console(width=200))
    output = capsys.readouterr().out
    assert "data-sheet value kept: A.h1, A.h2, " in output
    assert " (only one operating point)" in output


@pytest.mark.parametrize("seeds", [3, pytest.param(8, marks=pytest.mark.prove)])
def test_the_noise_of_readings_is_no_misfit(seeds: int, tmp_path: Path) -> None:
    """Laws that hold have no more misfit than their stated accuracy leaves open with so many
    points, however the readings scatter; one that does not, its own."""
    run = calibration_run(RIGS["abc"])
    own, bent = [], []
    for seed in range(21, 21 + seeds):
        readings = record(run, seed=seed).readings
        write_csv(tmp_path / "r.csv", readings)
        own.append(_calibrate(tmp_path / "r.csv", tmp_path)["A"]["misfit"]["pump"]["value"])
        share = 1.0 + 0.02 * np.sin(readings["A.n [rpm]"] / 20.0)
        write_csv(tmp_path / "r.csv", {**readings, "A.Q [l/h]": readings["A.Q [l/h]"] * share})
        bent.append(_calibrate(tmp_path / "r.csv", tmp_path)["A"]["misfit"]["pump"]["value"])
    assert np.median(own) < 0.3
    assert 1.0 < np.median(bent)


def test_what_is_off_bends_no_fit(tmp_path: Path) -> None:
    """A tenth of the points with a wrong flow does not bend the fit. Of a power meter 10 W
    high, its bound, where a data sheet knows the power at rest to 0.5 W, all points lie beside
    the law, none scatters about it: no tenth of what 10 W are."""
    wrong = np.where(np.arange(10_000) < 30, 0.6, 1.0)
    file = _noise_free(
        tmp_path, lambda r: {**r, "A.Q [l/h]": r["A.Q [l/h]"] * wrong[: len(r["A.Q [l/h]"])]}
    )
    found = _calibrate(file, tmp_path)["A"]
    assert 3 == found["misfit"]["pump"]["set_aside"]
    assert found["parameters"]["C2"]["value"] == pytest.approx(2.0, rel=1e-2)
    file = _noise_free(tmp_path, lambda r: {**r, "A.P_el [W]": r["A.P_el [W]"] + 10.0})
    assert 2.0 > _calibrate(file, tmp_path)["A"]["misfit"]["power"]["value"]


def test_a_speed_at_which_no_point_fits_is_told(tmp_path: Path, capsys: Capsys) -> None:
    """Points that were set aside because the law is wrong there look like outliers, but for their
    speed."""

    def throttled(readings: Any) -> dict[str, Any]:
        fast = readings["A.n [rpm]"] > 0.95 * readings["A.n [rpm]"].max()
        return {**readings, "A.Q [l/h]": np.where(fast, 0.6, 1.0) * readings["A.Q [l/h]"]}

    _calibrate(_noise_free(tmp_path, throttled), tmp_path)
    text = " ".join(capsys.readouterr().out.split())
    assert re.search(r"A\.pump: \d+ of \d+ points, those with A\.n from \S+ to \S+ rpm, were", text)


def test_the_flow_in_a_main_is_not_what_is_dosed() -> None:
    """No pump of litres per hour is fitted to the meter of the main it doses into."""
    plant = ROOT / "plants" / "dosing-skid"
    with pytest.raises(CalibrationRefused, match="no module has a law with all its readings"):
        rulec.calibrate(plant, plant / "examples" / "gas_in_head.csv")


def test_a_module_that_stood_keeps_its_values(tmp_path: Path, capsys: Capsys) -> None:
    """Where one of several pumps never ran, the others are calibrated, and this one is named."""
    write_plant(tmp_path, {"A": "dosing-pcp", "B": "dosing-pcp", "C": "pump-set"})
    file = _noise_free(tmp_path, lambda r: {**r, "C.Q [l/min]": 0 * r["A.Q [l/h]"]})
    found = json_of("calibrate", tmp_path, file, "--force", "-o", tmp_path / "f.yaml")
    assert "left unchanged: C\n" in capsys.readouterr().out
    assert {"A", "B"} == set(found["modules"])


def test_a_law_without_its_readings_keeps_its_sheet(tmp_path: Path, capsys: Capsys) -> None:
    """No power meter of A, no gauge of C: the other laws are fitted, and these are named."""

    def fewer(readings: Any) -> dict[str, Any]:
        return {n: v for n, v in readings.items() if not n.startswith(("A.P_el", "C.dp"))}

    found = _calibrate(_noise_free(tmp_path, fewer), tmp_path)
    assert set(found) == {"A", "B"}
    assert not {"P0", "P1", "eta"} & set(found["A"]["parameters"])
    assert found["A"]["parameters"]["C2"]["value"] == pytest.approx(2.0, rel=1e-3)
    assert found["B"]["parameters"]["eta"]["value"] == pytest.approx(0.70, rel=1e-3)
    out = " ".join(capsys.readouterr().out.split())
    assert "A.power keeps its data sheet: no reading of A.P_el" in out
    assert "no readings of a law, left unchanged: C" in out


@pytest.mark.parametrize(("off", "far"), [(0.2, {}), (-1.0, {0: 10.0})])
def test_an_error_of_a_gauge_that_nobody_believes_explains_no_misfit(
    off: float, far: dict[int, float]
) -> None:
    """Points that lie evenly beside the law, as if a gauge were 2 u off its class, or 10 u."""
    scatter = 0.01 * np.random.default_rng(1).standard_normal(100)
    near: Any = SimpleNamespace(
        off=off + scatter, jacobian=np.zeros((100, 0)), errors=[np.full(100, 0.1)]
    )
    misfit, found = own_misfit(near, np.zeros(0), SheetPriors.of([]), 0.0, 0.0)
    assert misfit == pytest.approx(1.0 if far else 0.01, rel=0.2)
    assert found == pytest.approx(far, rel=0.1)
