"""A fault that is there from the first sample, and too small for any one operating point."""

import pytest
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose

from tests.dosing import INSIDE, TABLE_1, Sensing, operating_points, record, visiting_run
from tests.method.readings import built, calibrated, recording, ruleset

POINTS = 5
HOLD = 20


def said(fault: str, degree: float, seed: int, lead_in: int = 0) -> Diagnosis:
    plant, rules = built("abc"), calibrated(ruleset("abc"))
    faults = {fault: degree} if fault else {}
    sensing: Sensing = TABLE_1 if fault else INSIDE
    run = visiting_run(plant, operating_points(plant, POINTS), faults, lead_in, HOLD)
    return diagnose(recording(rules, record(run, sensing, seed).readings), rules)


@pytest.mark.parametrize("fault", ["A.P_el.high", "B.P_el.low"])
def test_a_wrong_power_reading_is_found_by_its_course_over_operating_points(fault: str) -> None:
    """10 % of 90 to 200 W; the bound of the meter allows 10 W, but the same at all points."""
    for seed in range(3):
        (finding,) = said(fault, 0.1, 8100 + seed).findings
        period = (finding.fault.id, finding.since, finding.until)
        assert (fault, 0.0, POINTS * HOLD - 1.0) == period
        assert finding.lower <= 0.1 + 0.01
        assert finding.upper >= 0.1 - 0.01


def test_sound_visits_say_nothing() -> None:
    for seed in range(40):
        found = said("", 0.0, 8200 + seed)
        assert ("ok", (), ()) == (found.status, found.findings, found.unknown)


@pytest.mark.parametrize("fault", ["A.P_el.high", "A.leakage", "B.clogging"])
def test_a_fault_that_begins_on_the_way_keeps_its_beginning(fault: str) -> None:
    """Sound for a while at the first point: the whole recording is not blamed."""
    for seed in range(3):
        findings = said(fault, 0.3, 8300 + seed, lead_in=HOLD).findings
        assert {fault} == {f.fault.id for f in findings}
        assert HOLD <= min(f.since for f in findings)
