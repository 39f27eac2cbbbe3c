"""A reading that is off by so much: the degree is in its unit, in the terminal and everywhere."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime import limits
from rulec_runtime.report.text import degree

from rulec.cli import main
from rulec.passes.pipeline import compile_plant
from tests.loop import rig

SIZES = [("A.T.high", 2.0, "K"), ("A.T.low", 3.0, "K"), ("A.I_Q.high", 0.5, "mA")]


def _diagnosed(folder: Path, fault: str, size: float) -> dict[str, Any]:
    """Inject a fault in the second half and diagnose."""
    calibration = ["calibrate", str(folder), str(rig.run_in(folder))]
    assert 0 == main([*calibration, "-o", str(folder / "found.yaml")])
    (folder / "plant.yaml").open("a", encoding="utf-8").write("calibration: [found.yaml]\n")
    speed, T = np.repeat([900.0, 1100.0, 1000.0], 4), np.repeat([38.0, 48.0, 44.0], 4)
    inputs = {k: v for k, v in rig.readings(speed, T).items() if "n" in k[:3] or "T" in k[:3]}
    arguments = [str(folder), str(rig.write(folder / "in.csv", inputs))]
    made = ["-o", str(folder / "made.csv"), "--noise", "3", "--fault", f"{fault}={size}@60:119"]
    assert 0 == main(["simulate", *arguments, *made])
    told = ["--json", str(folder / "d.json"), "--report", str(folder / "d.html")]
    assert 0 == main(["diagnose", str(folder), str(folder / "made.csv"), *told])
    found: dict[str, Any] = json.loads((folder / "d.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize(("fault", "size", "unit"), SIZES)
def test_an_offset_is_found_with_its_size_in_the_unit(
    fault: str, size: float, unit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Terminal, JSON and page say the same: so many kelvin, no share of 331 K."""
    (finding,) = _diagnosed(rig.plant(tmp_path), fault, size)["findings"]
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
    folder = rig.plant(tmp_path)
    assert 0 == main(["matrix", str(folder), "--json", str(tmp_path / "m.json")])
    matrix = json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))
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


def test_a_size_beyond_the_range_of_the_sensor_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = rig.plant(tmp_path)
    arguments = ["simulate", str(folder), str(rig.run_in(folder)), "-o", str(tmp_path / "o.csv")]
    assert 0 != main([*arguments, "--fault", "A.T.high=200"])
    assert "A.T.high: its degree lies between 0 and 100 K" in capsys.readouterr().err
