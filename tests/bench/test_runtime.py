"""Judging whole recordings."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.recordings.recording import Recording

from tests.bench.conftest import Add
from tests.bench.row import least
from tests.conftest import compiled
from tests.rig.follower.plants import Planted, recorded

MILLION = 1_000_000
LONG = 100_000
MANY = 10_000
ROUNDS = 3


def tiled(recording: Recording, samples: int) -> Recording:
    """The same readings again and again, one sample a second."""
    times = -(-samples // len(recording))
    return replace(
        recording,
        time=np.arange(float(samples)),
        values={name: np.tile(v, times)[:samples] for name, v in recording.values.items()},
        segment=np.zeros(samples, dtype=int),
    )


@pytest.mark.parametrize(("plant", "fault"), [("abc", "A.leakage"), ("mixing-rig", "D.clogging")])
@pytest.mark.parametrize("call", [diagnose, trace])
def test_a_long_recording(plant: str, fault: str, call: Callable[..., Any], add: Add) -> None:
    """Ten parts without fault to one with plateaus of a fault."""
    rules = compiled(plant)
    planted = [Planted(fault, degree, a, a + 10) for degree, a in ((0.2, 810), (0.4, 830))]
    recording = tiled(recorded(rules, 880, planted, 1.0, np.random.default_rng(3)), LONG)
    found = least(lambda: call(recording, rules), ROUNDS if call is diagnose else 1)
    goal = 5.0 if call is diagnose else None
    add(f"{call.__name__} {LONG} samples of {plant}", found, "s", goal)


def test_hundreds_of_findings(add: Add) -> None:
    """A fault that comes and goes with every second stretch, each time another one."""
    rules, random = compiled("abc"), np.random.default_rng(1)
    faults = [f.id for f in rules.faults if not f.in_sensor and f.lowest <= 0.3]
    firsts = range(100, MANY - 26, 26)
    planted = [Planted(faults[k % len(faults)], 0.3, a, a + 13) for k, a in enumerate(firsts)]
    recording = recorded(rules, MANY, planted, 1.0, random)
    found = diagnose(recording, rules).findings
    assert len(found) > 0.9 * len(planted)
    taken = least(lambda: diagnose(recording, rules), ROUNDS)
    add(f"diagnose {MANY} samples with {len(found)} findings", taken, "s", 1.5)


def test_a_healthy_million(add: Add) -> None:
    """Plant abc at rest."""
    rules, random = compiled("abc"), np.random.default_rng(2)
    recording = tiled(recorded(rules, MANY, [], 1.0, random), MILLION)
    assert diagnose(recording, rules).findings == ()
    taken = least(lambda: diagnose(recording, rules), ROUNDS)
    add(f"diagnose {MILLION} healthy samples of abc", taken, "s", 3.0)
