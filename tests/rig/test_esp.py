"""Pump curves of the test loop: a table of points calibrates the plain law on water."""

import json
from pathlib import Path

import pytest
from rulec_runtime.recordings.point_table import is_point_table
from rulec_runtime.recordings.recording import read_recording

from rulec.cli import main
from tests.conftest import ROOT, compiled, plain_yaml
from tests.rig import real
from tests.rig.esp import FOLDER, IMPELLERS, of_glycerin, of_water, write_points

COUNTS = {"P37": (107, 699), "P100": (61, 1024), "HC12500": (98, 1072)}
"""Points with water, and with glycerin."""

PLANT = ROOT / "plants" / "esp-pump"


@pytest.fixture(scope="module")
def folder() -> Path:
    """Folder of the measured points."""
    return real(FOLDER)


@pytest.mark.parametrize("impeller", IMPELLERS)
def test_points_are_a_table(folder: Path, impeller: str, tmp_path: Path) -> None:
    """Every point of an impeller stands in the recording of its liquid; sweeps over a valve are no
    transients."""
    file, ruleset, counts = tmp_path / "points.csv", compiled("esp-pump"), []
    for chosen in (of_water, of_glycerin):
        counts.append(write_points(folder, impeller, chosen, file))
        assert is_point_table(read_recording(file, ruleset), ruleset)
    assert COUNTS[impeller] == tuple(counts)


@pytest.mark.parametrize("impeller", IMPELLERS)
def test_shipped_calibration_is_that_of_the_water_points(
    folder: Path, impeller: str, tmp_path: Path
) -> None:
    """`rulec calibrate` on the water points gives the file in plants/. A parabola with affinity
    laws explains at least 99.6 % of the variance."""
    water, target, form = (tmp_path / name for name in ("water.csv", "found.yaml", "found.json"))
    write_points(folder, impeller, of_water, water)
    words = ["calibrate", str(PLANT), str(water), "-o", str(target), "--json", str(form)]
    assert main(words) == 0
    expected, actual = (
        plain_yaml(file)["modules"]["pump"]["parameters"]
        for file in (PLANT / f"calibration-{impeller.lower()}.yaml", target)
    )
    for name, parameter in expected.items():
        found = actual[name]["value"]
        assert parameter["value"] == pytest.approx(found, abs=0.01 * parameter["u"])
    misfit = json.loads(form.read_text(encoding="utf-8"))["modules"]["pump"]["misfit"]
    assert all(part["r2"] > 0.996 for part in misfit.values())
