"""From a finding with alternatives to the step that tells them apart, and what is known then."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rulec.cli import main
from tests.conftest import ROOT, compiled

PLANT = ROOT / "plants" / "abc"
LIMITS = """\
limits: abc
inputs:
  A.n: {lowest: 700, highest: 1000, unit: rpm, rate: 10, hold: 120, costs: product}
  B.n: {lowest: 13, highest: 16, unit: Hz, rate: 0.2}
modules:
  C: {costs: product}
"""


def _inputs(file: Path, points: list[tuple[float, float]]) -> Path:
    """A recording of set points, 60 s each."""
    rows = [f"{60 * i + k},{a},{b}" for i, (a, b) in enumerate(points) for k in range(60)]
    file.write_text("\n".join(["time [s],A.n [rpm],B.n [rpm]", *rows]) + "\n", encoding="utf-8")
    return file


def _diagnosed(
    tmp_path: Path, inputs: Path, fault: str, seed: int, *more: str
) -> list[dict[str, Any]]:
    """The findings of a simulated recording, by a ruleset that is compiled already."""
    recording, told = tmp_path / "recording.csv", tmp_path / "findings.json"
    ruleset = tmp_path / "abc.ruleset.json"
    if not ruleset.exists():
        ruleset.write_text(compiled("abc").to_json(), encoding="utf-8")
    noise = ["--fault", fault, "--noise", str(seed)]
    assert main(["simulate", str(ruleset), str(inputs), "-o", str(recording), *noise]) == 0
    assert main(["diagnose", str(ruleset), str(recording), "--json", str(told), *more]) == 0
    findings: list[dict[str, Any]] = json.loads(told.read_text(encoding="utf-8"))["findings"]
    return findings


HERE = (900.0, 900.0)
SEEDS = range(1, 5)


@pytest.mark.parametrize("fault", ["A.clogging", "B.widening"])
def test_step_leads_from_two_causes_to_one(tmp_path: Path, fault: str) -> None:
    """Where one operating point leaves two causes, that one and the proposed one name one."""
    unclear = 0
    for seed in SEEDS:
        inputs = _inputs(tmp_path / "inputs.csv", [HERE, HERE])
        (found,) = _diagnosed(tmp_path, inputs, f"{fault}=0.1", seed)
        assert ("step" in found) == bool(found["alternatives"])
        if not found["alternatives"]:
            continue
        unclear += 1
        assert all(part["now"] < 4.0 < part["then"] for part in found["step"]["apart"])
        there = dict(zip(("A.n", "B.n"), HERE, strict=True))
        there |= {part["input"]: 60.0 * part["to"] for part in found["step"]["changes"]}
        inputs = _inputs(tmp_path / "inputs.csv", [HERE, (there["A.n"], there["B.n"])])
        (closed,) = _diagnosed(tmp_path, inputs, f"{fault}=0.1", seed)
        assert closed["fault"] == fault
        assert closed["alternatives"] == []
        assert "step" not in closed
    assert unclear >= len(SEEDS) // 2


def test_step_keeps_a_file_of_limits_and_says_what_it_costs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "limits.yaml"
    file.write_text(LIMITS, encoding="utf-8")
    inputs = _inputs(tmp_path / "inputs.csv", [HERE, HERE])
    found = [
        finding
        for seed in SEEDS
        for finding in _diagnosed(tmp_path, inputs, "A.clogging=0.15", seed, "--limits", str(file))
        if finding["alternatives"]
    ]
    assert found
    for finding in found:
        (change,) = finding["step"]["changes"]
        assert change["input"] == "B.n"
        assert 13.0 <= change["to"] <= 16.0
        assert finding["step"]["ramp"] == pytest.approx(abs(change["to"] - change["from"]) / 0.2)
        assert finding["step"]["costs_product"] == ["C"]
    told = " ".join(re.sub("[│├└─]", " ", capsys.readouterr().out).split())
    assert "to tell them apart: lower B.n from" in told
    assert "this costs product (C)" in told


def test_matrix_tells_the_step_of_each_pair(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = tmp_path / "matrix.json"
    assert main(["matrix", str(PLANT), "--separate", "--json", str(told)]) == 0
    assert "of the other 10 one step tells 10 apart" in " ".join(capsys.readouterr().out.split())
    pairs = json.loads(told.read_text(encoding="utf-8"))["separate"]
    assert len(pairs) == 16
    for pair in (p for p in pairs if not p["apart_already"]):
        assert pair["split"]
        assert [part["degree"] for part in pair["sigma"]] == [0.1, 0.2]
        assert np.all([part["then"] > max(4.0, part["now"]) for part in pair["sigma"]])
        assert all(change["unit"] == "rpm" for change in pair["changes"])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("unit: rpm", "unit: bar", "KB073"),
        ("lowest: 700", "lowest: 1700", "KB055"),
        ("rate: 10", "rate: 0", "KB026"),
        ("costs: product", "costs: money", "KB023"),
        ("hold: 120", "holds: 120", "KB020"),
        ("unit: rpm, rate", "unit: rpmm, rate", "KB050"),
    ],
)
def test_mistakes_in_limits_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, said: str
) -> None:
    file = tmp_path / "limits.yaml"
    file.write_text(LIMITS.replace(old, new, 1), encoding="utf-8")
    assert main(["matrix", str(PLANT), "--separate", "--limits", str(file)]) == 1
    assert capsys.readouterr().err.count(said) == 1


def test_limits_that_are_not_there_or_not_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    absent = str(tmp_path / "none.yaml")
    assert main(["matrix", str(PLANT), "--separate", "--limits", absent]) == 1
    assert "KB001" in capsys.readouterr().err
    assert main(["matrix", str(PLANT), "--limits", absent]) == 2
    assert "--separate" in capsys.readouterr().err


def test_plant_that_stores_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["matrix", str(ROOT / "plants" / "cascaded-tanks"), "--separate"]) == 1
    assert "stores" in capsys.readouterr().err
