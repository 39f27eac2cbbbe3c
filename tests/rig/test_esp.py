"""Pump curves of the test loop: a table of points calibrates the plain law on water."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from rulec_runtime.recordings.point_table import is_point_table
from rulec_runtime.recordings.recording import read_recording

from rulec.cli import main
from tests.conftest import ROOT, compiled, recordings_folder
from tests.rig.esp import (
    FOLDER,
    IMPELLERS,
    Choice,
    of_glycerin,
    of_pure_glycerin,
    of_water,
    write_points,
)

COUNTS = {"P37": (107, 699, 433), "P100": (61, 1024, 882), "HC12500": (98, 1072, 983)}
"""Points with water, with any glycerin, with pure glycerin."""


@pytest.fixture(scope="module")
def folder() -> Path:
    """Folder of the measured points."""
    found = recordings_folder() / FOLDER
    if not found.is_dir():
        pytest.skip(f"no real recordings at {found} (set RULEC_RECORDINGS)")
    return found


@pytest.mark.parametrize("impeller", IMPELLERS)
def test_points_are_written(folder: Path, impeller: str, tmp_path: Path) -> None:
    """Every point of an impeller stands in the recording of its liquid."""
    counts = [
        write_points(folder, impeller, chosen, tmp_path / "points.csv")
        for chosen in (of_water, of_glycerin, of_pure_glycerin)
    ]
    assert COUNTS[impeller] == tuple(counts)


@pytest.mark.parametrize("chosen", [of_water, of_glycerin])
@pytest.mark.parametrize("impeller", IMPELLERS)
def test_points_are_a_table(folder: Path, impeller: str, chosen: Choice, tmp_path: Path) -> None:
    """Sweeps over a valve are no transients."""
    write_points(folder, impeller, chosen, tmp_path / "points.csv")
    ruleset = compiled("esp-pump")
    assert is_point_table(read_recording(tmp_path / "points.csv", ruleset), ruleset)


@pytest.mark.parametrize("impeller", IMPELLERS)
def test_shipped_calibration_is_that_of_the_water_points(
    folder: Path, impeller: str, tmp_path: Path
) -> None:
    """`rulec calibrate` on the water points gives the file in plants/."""
    plant = ROOT / "plants" / "esp-pump"
    write_points(folder, impeller, of_water, tmp_path / "water.csv")
    _calibrate(plant, tmp_path / "water.csv", tmp_path / "found.yaml")
    shipped = plant / f"calibration-{impeller.lower()}.yaml"
    expected = yaml.safe_load(shipped.read_text(encoding="utf-8"))["modules"]["pump"]
    actual = yaml.safe_load((tmp_path / "found.yaml").read_text(encoding="utf-8"))["modules"][
        "pump"
    ]
    for name, parameter in expected["parameters"].items():
        assert parameter["value"] == pytest.approx(
            actual["parameters"][name]["value"], abs=0.01 * parameter["u"]
        )


@pytest.mark.parametrize("impeller", IMPELLERS)
def test_plain_law_fits_water(folder: Path, impeller: str, tmp_path: Path) -> None:
    """A parabola with affinity laws explains at least 99.6 % of the variance on water."""
    write_points(folder, impeller, of_water, tmp_path / "water.csv")
    _calibrate(ROOT / "plants" / "esp-pump", tmp_path / "water.csv", tmp_path / "found.yaml")
    found = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    misfit = found["modules"]["pump"]["misfit"]
    assert all(part["r2"] > 0.996 for part in misfit.values())


def _parameters(calibration: Path) -> dict[str, dict[str, float]]:
    """Values and uncertainties in a calibration file."""
    module = yaml.safe_load(calibration.read_text(encoding="utf-8"))["modules"]["pump"]
    parameters: dict[str, dict[str, float]] = module["parameters"]
    return parameters


def _calibrate(plant: Path, recording: Path, target: Path) -> None:
    form = str(target.with_suffix(".json"))
    assert main(["calibrate", str(plant), str(recording), "-o", str(target), "--json", form]) == 0
