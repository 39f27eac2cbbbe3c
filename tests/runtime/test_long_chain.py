"""Plants in which hundreds of estimates check each other."""

import tempfile
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.sensors.sensor_health import dead_of
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.diagnosis.steady.many_estimates import has_many
from rulec_runtime.recordings.recording import Recording

from rulec.passes.pipeline import compile_plant
from tests.bench.rigs import chain
from tests.conftest import ROOT
from tests.rig.follower.plants import Planted, recorded

SHORT, LONG = 40, 80
LEAK, DEGREE, ROWS = "D3_1.leakage", 0.3, 600


@cache
def rules_of(modules: int) -> Ruleset:
    with tempfile.TemporaryDirectory() as folder:
        text = chain(modules).replace("title: generated", f"title: generated\nkb: {ROOT / 'kb'}")
        Path(folder, "plant.yaml").write_text(text, encoding="utf-8")
        return compile_plant(Path(folder))


def leaking(rules: Ruleset, fault: str, first: int, last: int) -> Recording:
    planted = [Planted(fault, DEGREE, first, last)]
    return recorded(rules, ROWS, planted, 1.0, np.random.default_rng(5))


def found(rules: Ruleset, recording: Recording, fault: str) -> Finding:
    diagnosis = diagnose(recording, rules)
    (finding,) = diagnosis.findings
    assert (fault, ()) == (finding.fault.id, diagnosis.sensors)
    assert finding.lower < DEGREE < finding.upper
    return finding


@pytest.mark.prove
def test_fault_of_a_long_chain_is_found_in_time() -> None:
    """As in a short chain; twice as many modules take no more than three times as long.

    A mixer of a long chain shows a hundredth of its sensor's range, and the leak before it takes a
    little of that: it has to be small, and is not dead. Without that reading equal pumps would not
    be told apart."""
    took, first = {}, 2 * ROWS // 3
    for modules in (SHORT, LONG):
        rules = rules_of(modules)
        recording = leaking(rules, LEAK, first, ROWS)
        assert has_many(rules) == (modules == LONG)
        begin = time.process_time()
        assert found(rules, recording, LEAK).probability > 0.9
        took[modules] = time.process_time() - begin
    assert took[LONG] < 3.0 * took[SHORT]
    dead = recording.values["M3.dp"].copy()
    dead[first:] *= 0.01
    recording = replace(recording, values={**recording.values, "M3.dp": dead})
    ((one, rows),) = dead_of(recording, rules)
    assert (one.signal, rows.stop) == ("M3.dp", ROWS)
    assert rows.start == pytest.approx(first, abs=5.0)


@pytest.mark.parametrize(
    "fault", ["M0.clogging", pytest.param("M13.dp.high", marks=pytest.mark.prove)]
)
def test_fault_where_many_flows_meet_is_there_when_it_shows(fault: str) -> None:
    """Of hundreds of residuals most say nothing against that."""
    rules, first, last = rules_of(LONG), ROWS // 3, 2 * ROWS // 3
    finding = found(rules, leaking(rules, fault, first, last), fault)
    assert finding.since == pytest.approx(first, abs=5.0)
    assert finding.until == pytest.approx(last, abs=5.0)
