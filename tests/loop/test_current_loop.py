"""A pump whose flow meter is a current loop, made by hand: independent of the compiler."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.report.text import degree

from rulec.cli import main
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT
from tests.written import json_of, write_columns, write_plant

HERE = ROOT / "tests" / "loop"
V, C, b, K2 = 10.2, 5.5, 0.3, 7.3e-6
"""Truth in ml/rev, l/h/bar, 1/K over 20 degC, bar/(l/h)^2; other than the data sheet says."""


def plant(folder: Path) -> Path:
    """The plant with a knowledge base of its own."""
    shutil.copytree(ROOT / "kb", folder / "kb")
    shutil.copy(HERE / "warm-loop.yaml", folder / "kb" / "modules")
    shutil.copy(HERE / "current-loop.yaml", folder / "kb" / "sensors")
    return write_plant(folder, {"A": "warm-loop"}, kb="kb")


def readings(speed: Array, T: Array, seed: int = 1) -> dict[str, Array]:
    """Ten samples of each point, with noise; speed in rpm, T in degC."""
    # n V - C (1 + b (T - 20)) dp = sqrt(dp/k2), quadratic in sqrt(dp)
    loss, gap = 1.0 / np.sqrt(K2), C * (1.0 + b * (T - 20.0))
    root = (-loss + np.sqrt(loss**2 + 4.0 * gap * speed * V * 0.06)) / (2.0 * gap)
    flow = root * loss
    random = np.random.default_rng(seed)

    def noisy(values: Array, noise: float) -> Array:
        repeated = np.repeat(values, 10)
        return repeated + noise * random.standard_normal(len(repeated))

    return {
        "A.n [rpm]": noisy(speed, 0.1),
        "A.dp [bar]": noisy(root**2, 5e-4),
        "A.T [degC]": noisy(T, 0.02),
        "A.I_Q [mA]": noisy(4.0 + flow / 62.5, 1e-3),
    }


def write(path: Path, columns: dict[str, Array]) -> Path:
    """One sample a second."""
    return write_columns(path, {"time [s]": np.arange(len(columns["A.n [rpm]"])), **columns})


def run_in(folder: Path, varied: bool = True) -> Path:
    """A recording for calibration; its temperature stands unless `varied`."""
    speed = np.linspace(500.0, 1400.0, 30)
    T = 20.0 + 5.0 * (7 * np.arange(30) % 10) if varied else np.full(30, 40.0)
    return write(folder / "run-in.csv", readings(speed, T))


def _calibrate(folder: Path, recording: Path) -> dict[str, Any]:
    return dict(json_of("calibrate", folder, recording, "-o", folder / "found.yaml"))


def test_the_flow_is_what_the_equation_of_the_meter_says(tmp_path: Path) -> None:
    """Milliamperes are no flow: the truth comes back within its uncertainty."""
    folder = plant(tmp_path)
    found = _calibrate(folder, run_in(folder))
    parameters = found["modules"]["A"]["parameters"]
    for name, value in (("V", V), ("C", C), ("b", b), ("k2", K2)):
        assert abs(parameters[name]["value"] - value) < 3.0 * parameters[name]["u"]
    assert parameters["V"]["value"] == pytest.approx(V, rel=0.01)
    assert set(parameters) == {"V", "C", "b", "k2"}
    assert found["notes"] == []


def test_a_reading_that_stood_is_told_and_gets_the_bounds_of_its_sensor(tmp_path: Path) -> None:
    """No range "40 to 40 degC" that every later sample leaves."""
    folder = plant(tmp_path)
    found = _calibrate(folder, run_in(folder, varied=False))
    notes = [note for note in found["notes"] if note.startswith("A.T stood all the time")]
    assert 1 == len(notes)
    written = yaml.safe_load((folder / "found.yaml").read_text(encoding="utf-8"))
    entry = written["modules"]["A"]["range"]["T"]
    sensor = yaml.safe_load((folder / "kb/sensors/industrial-thermometer.yaml").read_text("utf-8"))
    bound = 2.0 * sensor["systematic"]["bound"] / sensor["coverage"]
    assert [entry["from"], entry["to"]] == pytest.approx([40 - bound, 40 + bound], abs=0.02)
    assert "its sensor" in entry["source"]
    assert "source" not in written["modules"]["A"]["range"]["n"]
    (folder / "plant.yaml").open("a", encoding="utf-8").write("calibration: [found.yaml]\n")
    assert 0 == main(["check", str(folder)])


SIZES = [("A.T.low", 3.0, "K"), ("A.I_Q.high", 0.5, "mA")]


def _diagnosed(folder: Path, fault: str, size: float) -> dict[str, Any]:
    """Inject a fault in the second half and diagnose."""
    _calibrate(folder, run_in(folder))
    (folder / "plant.yaml").open("a", encoding="utf-8").write("calibration: [found.yaml]\n")
    speed, T = np.repeat([900.0, 1100.0, 1000.0], 4), np.repeat([38.0, 48.0, 44.0], 4)
    inputs = {k: v for k, v in readings(speed, T).items() if "n" in k[:3] or "T" in k[:3]}
    arguments = [str(folder), str(write(folder / "in.csv", inputs))]
    made = ["-o", str(folder / "made.csv"), "--noise", "3", "--fault", f"{fault}={size}@60:119"]
    assert 0 == main(["simulate", *arguments, *made])
    page = folder / "d.html"
    return dict(json_of("diagnose", folder, folder / "made.csv", "--report", page))


@pytest.mark.parametrize(("fault", "size", "unit"), SIZES)
def test_an_offset_is_found_with_its_size_in_the_unit(
    fault: str, size: float, unit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Terminal, JSON and page say the same: so many kelvin, no share of 331 K."""
    (finding,) = _diagnosed(plant(tmp_path), fault, size)["findings"]
    assert (fault, unit) == (finding["fault"], finding["unit"])
    assert finding["lower"] <= size <= finding["upper"]
    text, words = capsys.readouterr().out, f"{finding['degree']:.3g} {unit}"
    where, side = fault.removeprefix("A.").split(".")
    assert f"{where} reads too {side} by {words}" in text
    page = (tmp_path / "d.html").read_text(encoding="utf-8")
    assert degree(finding["degree"], unit) in page
    assert f"degree [{unit}]" in page


def test_the_matrix_tells_what_can_be_seen_in_the_unit(tmp_path: Path) -> None:
    """The detectable size times the sensitivity is the threshold, as for every fault."""
    folder = plant(tmp_path)
    matrix = json_of("matrix", folder)
    units = dict(zip(matrix["faults"], matrix["units"], strict=True))
    assert {"A.leakage": "1", "A.T.high": "K", "A.I_Q.low": "mA"}.items() <= units.items()
    ruleset = compile_plant(folder)
    u = {r.id: r.u for r in ruleset.residuals}
    cells = [c for c in ruleset.cells if c.fault == "A.I_Q.high"]
    assert {"A.pump-meter", "A.line-meter"} == {c.residual for c in cells}
    for cell in cells:
        per_milliampere = 62.5 / 3.6e6
        assert cell.sensitivity == pytest.approx(-per_milliampere, rel=1e-6)
        threshold = limits.THRESHOLD * u[cell.residual]
        assert cell.detectable * per_milliampere == pytest.approx(threshold)
