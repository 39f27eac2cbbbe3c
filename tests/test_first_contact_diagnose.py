"""`diagnose` of a pump by its sheet: what nobody would believe is not told."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.live.follower import follow
from rulec_runtime.live.memory import nothing_yet
from rulec_runtime.recordings.recording import read_recording

from rulec.cli import main
from tests.conftest import ROOT, compiled
from tests.method.readings import calibrated
from tests.rig.follower.plants import first_rows, part_of
from tests.written import json_of, write_columns, write_exact, write_plant

HEAD = {"h0": (1.111, "bar"), "h1": (1.142e-4, "bar/(l/h)"), "h2": (3.04e-7, "bar/(l/h)**2")}
"""Head of the pump; usually known to 1.5 %."""
HEADS = {"pump.missing-head", "pump.dp.low"}
"""Two names for the same at each operating point."""


def plant(folder: Path, head: float = 1.0, doubt: float = 0.015) -> Path:
    """A centrifugal pump with a meter, its sheet's head times a factor."""
    sheet = ", ".join(
        f"{k}: {{value: {head * v:.9g}, unit: {u}, u: {doubt * v:.9g}, source: sheet}}"
        for k, (v, u) in HEAD.items()
    )
    return write_exact(
        write_plant(folder, {"pump": f"metered-centrifugal, parameters: {{{sheet}}}"})
    )


def recorded(folder: Path, head: float = 1.0, fault: str = "") -> Path:
    """Two minutes at one operating point of a pump with this head."""
    inputs = {"pump.n [rpm]": np.full(120, 2650.0), "pump.Q [l/h]": np.full(120, 700.0)}
    given = write_columns(folder / "inputs.csv", {"t [s]": np.arange(120), **inputs})
    file = folder / "recording.csv"
    wrong = ["--fault", fault] if fault else []
    true = plant(folder / "real", head)
    assert main(["simulate", str(true), str(given), "-o", str(file), "--noise", "1", *wrong]) == 0
    return file


def rules(folder: Path, head: float = 1.0, u: float = 0.015) -> Ruleset:
    """The ruleset of the sheet."""
    file = folder / "sheet.ruleset.json"
    assert main(["compile", str(plant(folder / "sheet", head, u)), "-o", str(file)]) == 0
    return read_ruleset(file)


def knowing(ruleset: Ruleset, *names: str) -> Ruleset:
    """The same that knows some faults alone, and no others of readings."""
    return replace(
        ruleset,
        faults=tuple(f for f in ruleset.faults if f.id in names),
        cells=tuple(c for c in ruleset.cells if c.fault in names),
        unlisted=(),
        unlisted_cells=(),
    )


def said(folder: Path, ruleset: Ruleset, recording: Path) -> tuple[dict[str, Any], str]:
    """The diagnosis as JSON, and the heading of its page."""
    made, page = folder / "r.ruleset.json", folder / "d.html"
    made.write_text(ruleset.to_json(), encoding="utf-8")
    found = json_of("diagnose", made, recording, "--report", page)
    return found, page.read_text(encoding="utf-8").partition("<h1>")[2].partition("<")[0]


def test_an_own_fault_is_named_and_no_absurd_meter(tmp_path: Path) -> None:
    """30 % of the head missing at one operating point: no meter at eleven times the flow."""
    file = recorded(tmp_path, fault="pump.missing-head=0.3")
    found, _ = said(tmp_path, rules(tmp_path), file)
    (finding,) = found["findings"]
    assert "pump.missing-head" == finding["fault"]
    assert 0.3 == pytest.approx(finding["degree"], abs=0.03)
    others = {a["fault"] for a in finding["alternatives"] + finding["remote"]}
    assert "pump.dp.low" in others
    assert "pump.Q.high" not in others


def test_the_meter_that_is_wrong_keeps_a_degree_that_may_be(tmp_path: Path) -> None:
    """Half too high, where any larger degree leaves less: the true one is within the bounds."""
    file = recorded(tmp_path, fault="pump.Q.high=0.5")
    found, _ = said(tmp_path, calibrated(rules(tmp_path)), file)
    (finding,) = found["findings"]
    assert "pump.Q.high" == finding["fault"]
    assert finding["lower"] <= 0.5 <= finding["upper"]
    assert finding["degree"] < 1.0


METERS = ("pump.Q.high", "pump.Q.low", "pump.dp.high", "pump.dp.low")


def test_a_pump_that_is_not_as_its_sheet_says_blames_no_meter(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A tenth more head than the sheet says, at 6.6 u: told once, in terminal, page and JSON, and
    by a watch."""
    file, ruleset = recorded(tmp_path, 1.1), knowing(rules(tmp_path), *METERS)
    found, heading = said(tmp_path, ruleset, file)
    assert ("S", []) == (found["status"], found["findings"])
    (unknown,) = found["unknown"]
    assert unknown["from_sheet"]
    assert unknown["text"].startswith("pump is not as its sheet says, from the first sample")
    (off,) = unknown["disagree"]
    assert "pump.head-flow" == off["residual"]
    assert off["threshold"] < off["share"] < 0.3
    assert "is not as its sheet says" in capsys.readouterr().out
    assert "Not as its sheet says, from the first sample" == heading
    recording = read_recording(file, ruleset)
    *_, watched = follow(ruleset, nothing_yet(False), part_of(recording, 0, len(recording)))
    assert [unknown["text"]] == [period.text for period in watched.diagnosis.unknown]


def test_a_sheet_that_knows_little_judges_nothing(tmp_path: Path) -> None:
    """Where parameters may be off by 60 %, no head is wrong, and no meter either: propagation of
    their uncertainties to first order would name one."""
    found, _ = said(tmp_path, rules(tmp_path, u=0.6), recorded(tmp_path, 3.0))
    assert [] == found["findings"] == found["unknown"]
    for part in found["not_judged"]:
        assert "pump.head: its parameters are not known well enough; calibrate" in part["because"]
        assert "pump.missing-head" in part["because"]
    assert 0.0 == found["not_judged"][0]["since"]


@pytest.mark.parametrize("points", [3, 30])
def test_a_display_in_coarse_steps_raises_no_fault_and_hides_none(
    points: int, tmp_path: Path
) -> None:
    """A gauge in steps of 0.05 bar, 10 u of its class, at many or at few operating points."""
    random = np.random.default_rng(1)
    speed, flow = (
        np.repeat(np.resize(random.uniform(low, high, points), 30), 20)
        for low, high in ((1900, 2800), (300, 800))
    )
    inputs = {"t [s]": np.arange(600), "pump.n [rpm]": speed, "pump.Q [l/h]": flow}
    given = write_columns(tmp_path / "inputs.csv", inputs)
    ruleset, real = rules(tmp_path), plant(tmp_path / "real")
    for wrong, named in ([], set()), (["--fault", "pump.missing-head=0.2@300:600"], HEADS):
        file = tmp_path / "recording.csv"
        assert (
            main(["simulate", str(real), str(given), "-o", str(file), "--noise", "1", *wrong]) == 0
        )
        shown = pd.read_csv(file)
        shown["pump.dp [bar]"] = (20.0 * shown["pump.dp [bar]"]).round() / 20.0
        shown.to_csv(file, index=False)
        found, _ = said(tmp_path, ruleset, file)
        assert {f["fault"] for f in found["findings"]} <= named
        assert bool(found["findings"]) == bool(named)


def test_set_points_on_even_levels_are_no_coarse_display(tmp_path: Path) -> None:
    """Without noise, and with four heads equally far apart: a missing head of 10 % still shows."""
    speed = np.repeat(2000.0 * np.sqrt([1.0, 1.25, 1.5, 1.75]), 40)
    inputs = {"t [s]": np.arange(160), "pump.n [rpm]": speed, "pump.Q [l/h]": 0.2 * speed}
    given = write_columns(tmp_path / "inputs.csv", inputs)
    file, real = tmp_path / "recording.csv", plant(tmp_path / "real")
    wrong = ["--fault", "pump.missing-head=0.1@0:160"]
    assert main(["simulate", str(real), str(given), "-o", str(file), *wrong]) == 0
    found, _ = said(tmp_path, rules(tmp_path), file)
    assert HEADS >= {f["fault"] for f in found["findings"]} > set()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("runs", [0, 1, 300])
def test_a_pump_that_stands_makes_no_noise(runs: int) -> None:
    """After some rows at work, or from the start: a loss of exactly zero, at which the slope of a
    root is infinite, and a power that was never above its minimum."""
    rules = compiled("irrigation-booster")
    file = ROOT / "plants/irrigation-booster/examples/blocked_sprinklers.csv"
    recording = read_recording(file, rules)
    for name, column in recording.values.items():
        noise = 3.0 * np.random.default_rng(0).standard_normal(len(column)) + 60.0
        column[runs:500] = noise[runs:500] if name == "P.P_el" else 0.0
    night = first_rows(recording, 490)
    found = diagnose(night, rules)
    assert not found.findings
    assert found.not_judged
    assert all(period.rests for period in found.not_judged)


def test_a_gauge_that_never_moves_proves_no_flow_at_night() -> None:
    """It shows the pressure of the day; all others that show zero are right."""
    rules = compiled("irrigation-booster")
    file = ROOT / "plants/irrigation-booster/examples/blocked_sprinklers.csv"
    night = first_rows(read_recording(file, rules), 400)
    for name, column in night.values.items():
        column[200:] = 0.0 if name != "S.p" else column[0]
    night.values["S.p"][:] = night.values["S.p"][0]
    assert not [f.id for f in diagnose(night, rules).sensors if f.condition.name == "dead"]
