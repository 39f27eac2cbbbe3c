"""Faults that no reading tells apart share their probability, whatever their course."""

from __future__ import annotations

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.wording import actions, headline

from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate_with
from tests.conftest import compiled

SAMPLES = 240
TWINS = ("main.leakage", "main.Q.low")


@pytest.mark.parametrize("course", ["step", "ramp"])
@pytest.mark.parametrize("true", TWINS)
def test_a_leak_and_a_meter_that_reads_low_are_told_together(true: str, course: str) -> None:
    """A share of the flow is lost or not shown: all estimates move alike, at once or slowly."""
    rules = compiled("zema-hydraulic")
    time = np.arange(float(SAMPLES))
    grown = np.clip((time - 60.0) / 150.0, 0.0, 1.0) if course == "ramp" else time >= 60.0
    found = simulate_with(equations_of(rules), {}, {true: 0.1 * grown})
    values = sense(rules, found.values, SensorErrors(), np.random.default_rng(5), {})
    recording = Recording(
        time=time, values=values, segment=np.zeros(SAMPLES, dtype=int), missing=(), notes=()
    )
    findings = diagnose(recording, rules).findings
    assert findings
    for finding in findings:
        named = {finding.fault.id: finding.probability, **dict(finding.alternatives)}
        assert set(TWINS) <= set(named)
        assert named[TWINS[0]] == named[TWINS[1]]
        told = headline(rules, finding) + actions(rules, finding)
        for name in TWINS:
            fault = rules.fault_by_id[name]
            assert fault.action in told
