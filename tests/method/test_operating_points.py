"""What several operating points, several faults and several blocks give (method.md, section 6); a
fault that is there from the first sample, and too small for any one operating point."""

from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.diagnosis.steady.redundancy import blocks_of

from rulec.passes.pipeline import compile_plant
from tests.dosing import INSIDE, TABLE_1, Run, operating_points, record, visiting_run
from tests.method.readings import built, calibrated, recording, ruleset
from tests.written import write_plant

SEEDS = range(4)
POINTS, HOLD = 5, 20


def said(faults: dict[str, float], points: int, seed: int, lead: int = 0) -> Diagnosis:
    """The plant abc at one or several operating points."""
    plant, rules = built("abc"), calibrated(ruleset("abc"))
    run = visiting_run(plant, operating_points(plant, POINTS)[:points], faults, lead, HOLD)
    made = record(run, TABLE_1 if faults else INSIDE, seed)
    return diagnose(recording(rules, made.readings), rules)


def found(faults: dict[str, float], points: int, seed: int, lead: int = 0) -> tuple[Finding, ...]:
    return said(faults, points, seed, lead).findings


@pytest.mark.parametrize("fault", ["A.clogging", "A.dp.high", "A.widening", "A.dp.low"])
def test_five_points_separate_a_stiff_pumps_line_from_its_sensor(fault: str) -> None:
    """Degree 0.2 from the first sample on: the true fault is named, its twin is no alternative."""
    for seed in SEEDS:
        largest = max(found({fault: 0.2}, 5, 500 + seed), key=lambda f: f.until - f.since)
        assert fault == largest.fault.id
        assert 0.2 == pytest.approx(largest.degree, abs=0.05)


PAIRS = [
    {"A.leakage": 0.3, "B.clogging": 0.3},
    {"A.P_el.high": 0.4, "C.dp.low": 0.3},
    {"B.dp.high": 0.3, "C.clogging": 0.3},
]


@pytest.mark.parametrize("faults", PAIRS, ids=" and ".join)
def test_two_faults_at_once(faults: dict[str, float]) -> None:
    """Both are found with their degrees, each pointing at the other; healthy samples before."""
    findings = found(faults, 1, 610, lead=20)
    assert faults.keys() == {f.fault.id for f in findings}
    for finding in findings:
        assert faults[finding.fault.id] == pytest.approx(finding.degree, abs=0.02)
        assert {*faults} - {finding.fault.id} == set(finding.together)


@pytest.mark.parametrize("module", "AB")
def test_pairs_of_a_module_are_screened_too(module: str) -> None:
    """Leakage and widening of one module: at least one of the two is named."""
    pair = {f"{module}.leakage": 0.3, f"{module}.widening": 0.3}
    assert {f.fault.id for f in found(pair, 1, 650, lead=20)} & {*pair}


def test_pairs_that_cannot_be_told_apart_widen_the_bounds() -> None:
    """A wider line before a clogging mixer looks like a leak before a worse clogging: both are
    said, and the bounds of the clogging hold its degree either way."""
    findings = found({"B.widening": 0.3, "C.clogging": 0.3}, 1, 610, lead=20)
    named = {f.fault.id: f for f in findings}
    mixer = named.pop("C.clogging")
    (line,) = named.values()
    assert {"B.leakage", "B.widening"} == {line.fault.id, *(name for name, _ in line.alternatives)}
    assert mixer.lower <= 0.3 <= mixer.upper
    assert () == mixer.alternatives


def test_one_fault_then_a_second() -> None:
    """A leakage is named alone, then with a clogging elsewhere."""
    plant, rules = built("abc"), ruleset("abc")
    run = visiting_run(plant, operating_points(plant, 1), {}, 20, 40)
    time = run.operation.time
    faults = {
        "A.leakage": np.where(time >= 20, 0.3, 0.0),
        "B.clogging": np.where(time >= 40, 0.3, 0.0),
    }
    made = record(Run(plant, run.operation, faults), TABLE_1, 620)
    findings = diagnose(recording(rules, made.readings), rules).findings
    assert [("A.leakage", ()), ("A.leakage", ("B.clogging",)), ("B.clogging", ("A.leakage",))] == (
        sorted((f.fault.id, f.together) for f in findings)
    )


def test_never_more_faults_than_the_evidence_carries() -> None:
    """A single fault is never told as two, whatever its kind."""
    rules = ruleset("abc")
    for fault in (f for f in rules.faults if f.id[0] != "B"):  # as A
        assert all(not f.together for f in found({fault.id: 0.2}, 1, 630, lead=20)), fault.id


def test_modules_without_common_balance_are_blocks(tmp_path: Path) -> None:
    """Two plants side by side in one file: their faults are single faults, each in its block."""
    kinds = {"A": "dosing-pcp", "B": "dosing-pcp", "C": "static-mixer"}
    modules = {f"{k}{m}": t for k in "XY" for m, t in kinds.items()}
    connections = "XA -> XC, XB -> XC, YA -> YC, YB -> YC"
    rules = compile_plant(write_plant(tmp_path, modules, connections))
    flags = [zip(rules.observers, block, strict=True) for block in blocks_of(rules)]
    blocks = [{o.module[0] for o, inside in each if inside} for each in flags]
    assert [{"X"}, {"Y"}] == blocks
    plant, columns = built("abc"), {}
    for prefix, fault in (("X", "A.leakage"), ("Y", "C.clogging")):
        run = visiting_run(plant, operating_points(plant, 1), {fault: 0.3}, 20, 20)
        made = record(run, TABLE_1, 640).readings
        columns |= {n if n == "time [s]" else prefix + n: v for n, v in made.items()}
    findings = diagnose(recording(rules, columns), rules).findings
    assert {("XA.leakage", ()), ("YC.clogging", ())} == {(f.fault.id, f.together) for f in findings}


@pytest.mark.parametrize("fault", ["A.P_el.high", "B.P_el.low"])
def test_a_wrong_power_reading_is_found_by_its_course_over_operating_points(fault: str) -> None:
    """10 % of 90 to 200 W; the bound of the meter allows 10 W, but the same at all points."""
    for seed in range(3):
        (finding,) = found({fault: 0.1}, POINTS, 8100 + seed)
        period = (finding.fault.id, finding.since, finding.until)
        assert (fault, 0.0, POINTS * HOLD - 1.0) == period
        assert finding.lower <= 0.1 + 0.01
        assert finding.upper >= 0.1 - 0.01


def test_sound_visits_say_nothing() -> None:
    for seed in range(40):
        sound = said({}, POINTS, 8200 + seed)
        assert ("ok", (), ()) == (sound.status, sound.findings, sound.unknown)


@pytest.mark.parametrize("fault", ["A.P_el.high", "A.leakage", "B.clogging"])
def test_a_fault_that_begins_on_the_way_keeps_its_beginning(fault: str) -> None:
    """Sound for a while at the first point: the whole recording is not blamed."""
    for seed in range(3):
        findings = found({fault: 0.3}, POINTS, 8300 + seed, lead=HOLD)
        assert {fault} == {f.fault.id for f in findings}
        assert HOLD <= min(f.since for f in findings)
