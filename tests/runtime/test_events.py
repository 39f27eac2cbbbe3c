"""What comes and goes within a few samples is counted and pooled; transients and glitches are none.

Recordings of plant abc come from the independent simulator, a sample a second.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.json_form import diagnosis_form

from rulec.prove.truth import INSIDE, Run, operating_points, record, settling, visiting_run
from tests.method.readings import built, recording, ruleset

PERIOD, ON, DEGREE = 10, 2, 0.4


def made(points: int, hold: int, size: float = 0.0) -> Run:
    """A leakage is there for two seconds of every ten, at some operating points."""
    plant = built("abc")
    run = visiting_run(plant, operating_points(plant, points), {}, 0, hold)
    second = np.arange(run.operation.time.size) % PERIOD
    return replace(run, faults={"A.leakage": np.where((second >= 5) & (second < 5 + ON), size, 0)})


def read(run: Run, seed: int) -> Recording:
    return recording(ruleset("abc"), record(run, INSIDE, seed).readings)


@pytest.mark.parametrize(("points", "hold", "fewest"), [(1, 200, 17), (6, 60, 27)])
def test_a_leakage_that_comes_and_goes(points: int, hold: int, fewest: int) -> None:
    """At one operating point, and while set points move from time to time."""
    found = diagnose(read(made(points, hold, DEGREE), 1), ruleset("abc"))
    (finding,) = found.findings
    assert finding.fault.id == "A.leakage"
    assert finding.degree == pytest.approx(DEGREE, abs=0.02)
    assert finding.events is not None
    assert fewest <= finding.events.count <= points * hold // PERIOD
    assert finding.events.duration == pytest.approx(ON, abs=0.3)
    assert finding.text.endswith(f"; comes and goes: {finding.events.count} times, about 2 s each")
    assert found.status == "M"
    (form,) = diagnosis_form(found)["findings"]
    assert form["events"]["count"] == finding.events.count
    assert form["events"]["share"] == pytest.approx(ON / PERIOD, abs=0.07)
    assert {"A.n", "B.n"} == set(form["events"]["set_point"])


@pytest.mark.parametrize("seed", range(2))
def test_glitches_and_transients_are_no_events(seed: int) -> None:
    """A pressure that is off for one sample, every twenty seconds; set points that move every
    fifteen seconds, with the inertia of pumps and liquid."""
    glitches = read(made(1, 200), seed)
    glitches.values["A.dp"][10::20] *= 1.3
    for recorded in (glitches, read(settling(made(12, 15)), seed)):
        found = diagnose(recorded, ruleset("abc"))
        assert ((), ()) == (found.findings, found.unknown)
