"""Diagnosis of plants that store, on recordings made with their own balances.

True parameters are drawn within half of their stated uncertainty, sensors err within their class.
"""

from __future__ import annotations

import dataclasses
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.trace import trace
from rulec_runtime.output.terminal import Terminal
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.json_form import diagnosis_form, trace_csv
from rulec_runtime.report.page import report
from rulec_runtime.report.terminal_story import explain

from rulec.commands.matrix import json_form
from rulec.simulation.signature import signature_of
from tests.runtime.tanks import made, plant

PLANTS = ("cascaded-tanks", "wastewater-lab")

HALF_WINDOW = 256.0
"""Time between windows, s: half of 128 samples of 4 s."""

SHORT = 600
"""Samples that are enough where nothing is dated."""

BEFORE_UPPER = {"pump.leakage", "pump.u.high", "upper.lost-inflow"}
INTO_FIRST = {"supply.Q.high", "tank1.lost-inflow"}
OUT_OF_SECOND = {"pump2.Q.low", "tank2.unseen-outflow"}

FEW = ("upper.blockage", "lower.y.low", "supply.Q.high")
"""Asked about in every run, one of each kind."""

FAULTS = {
    # What the upper tank gets too little of looks the same wherever it is lost.
    "pump.leakage": ("cascaded-tanks", BEFORE_UPPER),
    "pump.u.high": ("cascaded-tanks", BEFORE_UPPER),
    "upper.lost-inflow": ("cascaded-tanks", BEFORE_UPPER),
    "pump.u.low": ("cascaded-tanks", set()),
    "upper.blockage": ("cascaded-tanks", set()),
    "lower.lost-inflow": ("cascaded-tanks", set()),
    "lower.blockage": ("cascaded-tanks", set()),
    "lower.y.high": ("cascaded-tanks", set()),
    "lower.y.low": ("cascaded-tanks", set()),
    # A meter that shows too much, and a line that loses what it has shown, are one to the tank.
    "supply.Q.high": ("wastewater-lab", INTO_FIRST),
    "tank1.lost-inflow": ("wastewater-lab", INTO_FIRST),
    "supply.Q.low": ("wastewater-lab", set()),
    "tank1.unseen-outflow": ("wastewater-lab", set()),
    "tank1.l.high": ("wastewater-lab", set()),
    "pump1.Q.low": ("wastewater-lab", set()),
    "lateral.Q.high": ("wastewater-lab", set()),
    "tank2.lost-inflow": ("wastewater-lab", set()),
    "tank2.unseen-outflow": ("wastewater-lab", OUT_OF_SECOND),
    "pump2.Q.low": ("wastewater-lab", OUT_OF_SECOND),
    "tank2.l.low": ("wastewater-lab", set()),
}
"""Fault to plant, and what cannot be told from it there."""


def judged(name: str, recording: Recording) -> Diagnosis:
    return diagnose(recording, plant(name))


@pytest.mark.parametrize(
    "seeds", [range(3), pytest.param(range(3, 10), marks=pytest.mark.prove)], ids=["few", "more"]
)
@pytest.mark.parametrize("name", PLANTS)
def test_healthy_recordings_have_no_finding(name: str, seeds: range) -> None:
    """No false alarm in ten recordings, three of them in every run."""
    for seed in seeds:
        said = judged(name, made(name, seed))
        assert [] == [f.fault.id for f in said.findings], seed
        assert () == said.unknown, seed


@pytest.mark.parametrize(
    "fault", [f if f in FEW else pytest.param(f, marks=pytest.mark.prove) for f in FAULTS]
)
def test_a_fault_that_begins_in_the_middle_is_found(fault: str) -> None:
    """As itself, or beside what cannot be told from it; with its degree, and from its beginning."""
    name, alike = FAULTS[fault]
    recording = made(name, 1, (fault, 0.2, 0.5))
    said = judged(name, recording)
    (finding,) = said.findings
    among = {finding.fault.id, *(other for other, _ in finding.alternatives)}
    assert fault in among
    assert among <= {fault} | alike
    begin = 0.5 * recording.time[-1]
    assert abs(finding.since - begin) < HALF_WINDOW
    # A tank that runs full or empty shows no more.
    assert finding.until == recording.time[-1] or said.not_judged
    if finding.fault.id == fault:
        assert finding.lower <= 0.2 <= finding.upper
        assert finding.upper - finding.lower < 0.12


def test_a_fault_that_goes_is_found_with_its_end() -> None:
    """Behind its end the recording is healthy again."""
    # A plant whose level stays within the range of its sensor.
    faulty = made("cascaded-tanks", 5, ("lower.y.high", 0.2, 0.3))
    healthy = made("cascaded-tanks", 5)
    back = faulty.time > 0.6 * faulty.time[-1]
    values = {n: np.where(back, healthy.values[n], v) for n, v in faulty.values.items()}
    (finding,) = judged("cascaded-tanks", replace(faulty, values=values)).findings
    assert finding.fault.id == "lower.y.high"
    assert abs(finding.since - 0.3 * faulty.time[-1]) < HALF_WINDOW
    assert abs(finding.until - 0.6 * faulty.time[-1]) < HALF_WINDOW


def test_evidence_is_in_the_unit_of_the_reading() -> None:
    """A tank that gets too little stands lower than predicted; the other is as it should be."""
    said = judged("wastewater-lab", made("wastewater-lab", 0, ("tank1.lost-inflow", 0.2, 0.5)))
    first, second = said.findings[0].evidence
    assert ("tank1.l", "-", "-") == (first.residual, first.verdict, first.expected)
    assert ("tank2.l", "0", "0") == (second.residual, second.verdict, second.expected)
    assert first.value < -first.threshold < 0.0
    out = Terminal(record=True, width=200, file=io.StringIO())
    explain(out, said)
    assert " mm" in out.export_text()


def test_what_is_missing_is_not_judged() -> None:
    """Gaps of given readings, of measured ones, and columns that are not there."""
    recording = made("cascaded-tanks", 0, count=SHORT)
    gone = (recording.time > 900.0) & (recording.time < 1500.0)
    blank = np.where(gone, np.nan, recording.values["pump.u"])
    said = judged("cascaded-tanks", _with(recording, {"pump.u": blank}))
    assert () == said.findings
    assert any("pump.u has no reading" in p.text for p in said.not_judged)
    assert 0 < said.judged < said.samples
    blank = np.where(gone, np.nan, recording.values["lower.y"])
    said = judged("cascaded-tanks", _with(recording, {"lower.y": blank}))
    assert () == said.findings
    assert any(p.text.startswith("lower.y: no reading") for p in said.not_judged)
    alone = {n: v for n, v in recording.values.items() if n != "pump.u"}
    said = judged("cascaded-tanks", replace(recording, values=alone, missing=("pump.u",)))
    assert ("C", 0) == (said.status, said.judged)
    nothing = {n: np.full(len(recording), np.nan) for n in recording.values}
    assert 0 == judged("cascaded-tanks", _with(recording, nothing)).judged


@pytest.mark.parametrize("count", [1, 2, 3, 10, 24, 60])
def test_short_recordings_do_not_fail(count: int) -> None:
    """A few samples give no finding, and no exception."""
    said = judged("wastewater-lab", made("wastewater-lab", 0, count=count))
    assert () == said.findings
    assert len(trace(made("wastewater-lab", 0, count=count), plant("wastewater-lab")).verdict) == (
        count
    )


def test_a_bad_model_is_measured_by_itself_and_does_not_alarm() -> None:
    """Errors that come and go, as of any real plant, raise the usual misfit; a remark says so."""
    recording = made("cascaded-tanks", 5)
    wave = 0.3 * np.sin(recording.time / 90.0) * np.sin(recording.time / 37.0)
    said = judged(
        "cascaded-tanks", _with(recording, {"lower.y": recording.values["lower.y"] + wave})
    )
    assert () == said.findings
    assert any("usually miss" in note for note in said.notes)


def test_every_form_tells_the_finding(tmp_path: Path) -> None:
    """Trace, JSON, terminal and report of a ruleset that went through a file."""
    file = tmp_path / "ruleset.json"
    file.write_text(plant("cascaded-tanks").to_json(), encoding="utf-8")
    ruleset = read_ruleset(file)
    recording = made("cascaded-tanks", 0, ("lower.blockage", 0.2, 0.5), SHORT)
    said = diagnose(recording, ruleset)
    form = diagnosis_form(said)
    assert ["lower.blockage"] == [f["fault"] for f in form["findings"]]
    result = trace(recording, ruleset)
    row = [f.id for f in ruleset.faults].index("lower.blockage")
    assert {"ok", "lower.blockage"} == set(result.verdict)
    assert result.degree[row, -1] == pytest.approx(0.2, abs=0.02)
    assert len(trace_csv(result).splitlines()) == len(recording) + 1
    assert "lower: at this level 20" in report(recording, said, result, "made", None)


def test_matrix_says_what_acts_alike() -> None:
    """Signs of the readings, and the faults that none of them tells apart."""
    ruleset = plant("wastewater-lab")
    found = signature_of(ruleset)
    assert found is not None
    form = json_form(ruleset, dataclasses.asdict(found))["stores"]
    signs = dict(zip(form["faults"], form["signs"], strict=True))
    assert ((-1, 0), (1, 0)) == (signs["tank1.lost-inflow"], signs["tank1.l.high"])
    assert ("supply.Q.high", "tank1.lost-inflow") in form["alike"]


def _with(recording: Recording, changed: dict[str, np.ndarray]) -> Recording:
    return replace(recording, values={**recording.values, **changed})
