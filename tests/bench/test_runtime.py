"""Judging whole recordings."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.recordings.recording import Recording, read_recording

from tests.bench.conftest import Add
from tests.bench.peers.evaluation import in_blocks
from tests.bench.row import least
from tests.conftest import compiled
from tests.dosing import RIGS, fault_replay, healthy_run, record, write_csv
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


def mostly_healthy(plant: str, fault: str, folder: Path) -> Recording:
    """Ten parts without fault to one with plateaus of a fault."""
    rig, readings = RIGS[plant], []
    for run in (healthy_run(rig, 800), fault_replay(rig, fault)):
        file = folder / f"{len(readings)}.csv"
        write_csv(file, record(run, seed=3).readings)
        readings.append(read_recording(file, compiled(plant)))
    healthy, faulty = readings
    values = {name: np.concatenate([v, faulty.values[name]]) for name, v in healthy.values.items()}
    samples = len(healthy) + len(faulty)
    return tiled(replace(healthy, time=np.arange(float(samples)), values=values), samples)


def inputs_of(recording: Recording, ruleset: Ruleset) -> dict[str, Any]:
    """Readings and their systematic uncertainties, all of the calibration."""
    inputs: dict[str, Any] = {"u:parameters": 1.0, "u:model": 1.0, **recording.values}
    for signal in ruleset.signals:
        inputs[f"u:{signal.id}"] = signal.standard * (signal.full_scale or 1.0)
    return inputs


@pytest.mark.parametrize(("plant", "fault"), [("abc", "A.leakage"), ("mixing-rig", "D.clogging")])
@pytest.mark.parametrize("call", [diagnose, trace])
def test_a_long_recording(
    plant: str, fault: str, call: Callable[..., Any], tmp_path: Path, add: Add
) -> None:
    """Healthy with faulty stretches; beside it the plan alone."""
    rules = compiled(plant)
    recording = tiled(mostly_healthy(plant, fault, tmp_path), LONG)
    names = [n for n in rules.plan.outputs if n.startswith(("R:", "u:", "q:", "s:"))]
    plan, inputs = rules.plan.select(names), inputs_of(recording, rules)
    alone = least(lambda: in_blocks(plan, inputs, LONG))
    found = least(lambda: call(recording, rules), ROUNDS if call is diagnose else 1)
    goal = 5.0 if call is diagnose else None
    add(f"{call.__name__} {LONG} samples of {plant}", found, "s", goal)
    add("    times the plan that it rests on", found / alone, "")


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
