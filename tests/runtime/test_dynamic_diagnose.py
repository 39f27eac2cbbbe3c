"""Diagnosis of plants that store, on recordings made with their own balances."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.stores import judge_windows
from rulec_runtime.diagnosis.stores.joined_windows import deviating_runs
from rulec_runtime.diagnosis.stores.window_fit import ErrorEstimate
from rulec_runtime.diagnosis.stores.windows import Window
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.json_form import trace_csv
from rulec_runtime.report.page import report
from rulec_runtime.report.wording import agreement

from tests.runtime.tanks import made, plant

HALF_WINDOW = 256.0
"""Time between windows, s: half of 128 samples of 4 s."""

SHORT = 600
"""Samples that are enough where nothing is dated."""

ALIKE = {
    # What the upper tank gets too little of looks the same wherever it is lost.
    "cascaded-tanks": [{"pump.leakage", "pump.u.high", "upper.lost-inflow"}],
    # A meter that shows too much, and a line that loses what it has shown, are one to the tank.
    "wastewater-lab": [
        {"supply.Q.high", "tank1.lost-inflow"},
        {"pump2.Q.low", "tank2.unseen-outflow"},
    ],
}
"""What cannot be told from each other."""

FAULTS = {
    "cascaded-tanks": "pump.leakage pump.u.high pump.u.low upper.lost-inflow upper.blockage "
    "lower.lost-inflow lower.blockage lower.y.high lower.y.low",
    "wastewater-lab": "supply.Q.high supply.Q.low tank1.lost-inflow tank1.unseen-outflow "
    "tank1.l.high pump1.Q.low lateral.Q.high tank2.lost-inflow tank2.unseen-outflow pump2.Q.low "
    "tank2.l.low",
}
EVERY_TIME = "upper.blockage"
"""Asked about in every run."""


def judged(name: str, recording: Recording, **added: np.ndarray | float) -> Diagnosis:
    """What is said where something is added to readings."""
    values = {n: v + added.get(n.replace(".", "_"), 0.0) for n, v in recording.values.items()}
    return diagnose(replace(recording, values=values), plant(name))


@pytest.mark.parametrize(
    "seeds", [range(2), pytest.param(range(2, 10), marks=pytest.mark.prove)], ids=["few", "more"]
)
@pytest.mark.parametrize("name", FAULTS)
def test_healthy_recordings_have_no_finding(name: str, seeds: range) -> None:
    for seed in seeds:
        said = judged(name, made(name, seed))
        assert [] == [f.fault.id for f in said.findings], seed
        assert () == said.unknown, seed


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        pytest.param(name, fault, marks=() if fault == EVERY_TIME else pytest.mark.prove)
        for name, faults in FAULTS.items()
        for fault in faults.split()
    ],
)
def test_a_fault_that_begins_in_the_middle_is_found(name: str, fault: str) -> None:
    """As itself, or beside what cannot be told from it; with its degree, and from its beginning."""
    recording = made(name, 1, (fault, 0.2, 0.5))
    said = judged(name, recording)
    (finding,) = said.findings
    among = {finding.fault.id, *(other for other, _ in finding.alternatives)}
    assert fault in among
    assert among == {fault} or any(among <= alike for alike in ALIKE[name])
    assert abs(finding.since - 0.5 * recording.time[-1]) < HALF_WINDOW
    # A tank that runs full or empty shows no more.
    assert finding.until == recording.time[-1] or said.not_judged
    if finding.fault.id == fault:
        assert finding.lower <= 0.2 <= finding.upper
        assert finding.upper - finding.lower < 0.12


def test_a_fault_that_goes_is_found_with_its_end() -> None:
    # A plant whose level stays within the range of its sensor.
    faulty = made("cascaded-tanks", 5, ("lower.y.high", 0.2, 0.3), until=0.6)
    (finding,) = judged("cascaded-tanks", faulty).findings
    assert finding.fault.id == "lower.y.high"
    assert finding.lower <= 0.2 <= finding.upper
    assert abs(finding.since - 0.3 * faulty.time[-1]) < HALF_WINDOW
    assert abs(finding.until - 0.6 * faulty.time[-1]) < HALF_WINDOW


def test_evidence_and_frequencies() -> None:
    """Of what fits alike the more usual is named first."""
    rules, lost = plant("wastewater-lab"), {"tank1.lost-inflow", "supply.Q.high"}
    recording = made("wastewater-lab", 2, ("tank1.lost-inflow", 0.2, 0.5))
    for usual in lost:
        faults = (replace(f, frequency="common") if f.id == usual else f for f in rules.faults)
        said = diagnose(recording, replace(rules, faults=tuple(faults)))
        (finding,) = said.findings
        assert (usual, lost - {usual}) == (finding.fault.id, {n for n, _ in finding.alternatives})
    first, second = finding.evidence
    assert ("tank1.l", "-", "-") == (first.residual, first.verdict, first.expected)
    assert ("tank2.l", "0", "0") == (second.residual, second.verdict, second.expected)
    assert first.value < -first.threshold < 0.0


def test_what_is_missing_is_not_judged() -> None:
    recording = made("cascaded-tanks", 0, count=SHORT)
    gone = (recording.time > 900.0) & (recording.time < 1500.0)
    blank = np.where(gone, np.nan, 0.0)
    for name, why in (("pump_u", "pump.u has no reading"), ("lower_y", "lower.y: no reading")):
        said = judged("cascaded-tanks", recording, **{name: blank})
        assert () == said.findings
        assert any(why in p.text for p in said.not_judged)
        assert 0 < said.judged < said.samples
    alone = {n: v for n, v in recording.values.items() if n != "pump.u"}
    said = judged("cascaded-tanks", replace(recording, values=alone, missing=("pump.u",)))
    assert ("C", 0) == (said.status, said.judged)
    assert 0 == judged("cascaded-tanks", recording, pump_u=np.nan, lower_y=np.nan).judged


@pytest.mark.parametrize("count", [1, 2, 3, 24])
def test_short_recordings_do_not_fail(count: int) -> None:
    recording = made("wastewater-lab", 0, count=count)
    assert () == judged("wastewater-lab", recording).findings
    assert len(trace(recording, plant("wastewater-lab")).verdict) == count


def test_a_bad_model_is_measured_by_itself_and_does_not_alarm() -> None:
    """Errors that come and go, as of any real plant, raise the usual misfit; a remark says so."""
    recording = made("cascaded-tanks", 5)
    wave = 0.3 * np.sin(recording.time / 90.0) * np.sin(recording.time / 37.0)
    said = judged("cascaded-tanks", recording, lower_y=wave)
    assert () == said.findings
    assert any("usually miss" in note for note in said.notes)


def blocked() -> Diagnosis:
    recording = made("cascaded-tanks", 0, ("lower.blockage", 0.2, 0.5), SHORT)
    return diagnose(recording, plant("cascaded-tanks"))


def test_a_reading_that_contradicts_its_finding_is_told() -> None:
    found = blocked()
    finding = found.findings[0]
    opposite = replace(finding.evidence[0], verdict="+", expected="-")
    told = agreement(found.ruleset, finding, opposite)
    assert "✗ not as predicted" == told


def test_trace_and_page_tell_the_finding_by_a_ruleset_of_a_file(tmp_path: Path) -> None:
    file = tmp_path / "ruleset.json"
    file.write_text(plant("cascaded-tanks").to_json(), encoding="utf-8")
    ruleset, fault = read_ruleset(file), "lower.blockage"
    recording = made("cascaded-tanks", 0, (fault, 0.2, 0.5), SHORT)
    said, result = diagnose(recording, ruleset), trace(recording, ruleset)
    assert {"ok", fault} == set(result.verdict)
    row = [f.id for f in ruleset.faults].index(fault)
    assert result.degree[row, -1] == pytest.approx(0.2, abs=0.02)
    assert len(trace_csv(result).splitlines()) == len(recording) + 1
    assert "lower: 20" in report(recording, said, result, "made", None)


@pytest.mark.parametrize(
    ("degrees", "named"), [((0.20, 0.22, 0.21), True), ((0.1, 2.4, 4.9), False)]
)
def test_a_degree_that_differs_from_window_to_window_explains_nothing(
    degrees: tuple[float, ...], named: bool
) -> None:
    """Its bounds hold zero, though it fits each window."""
    faults = {fault.id: fault for fault in plant("cascaded-tanks").faults}
    window = Window(time=np.arange(9.0), inputs=np.zeros((9, 0)), measured=np.zeros((9, 0)))
    prior, name = ErrorEstimate(np.zeros(0), np.zeros((0, 0))), next(iter(faults))
    tests = [{name: judge_windows.Tested(degree, 0.01, 1.0, True)} for degree in degrees]
    (run,) = deviating_runs(
        [judge_windows.Judged(window, prior, deviating=True, tests=t) for t in tests],
        faults,
        lambda _: None,
    )
    assert (run.cause is not None, run.brief) == (named, False)
