"""Judging: the rig's plan with all uncertainties, whole recordings, and the smallest call."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.plan import Plan
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.trace import trace
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.passes.pipeline import compile_plant
from rulec.prove.truth import RIGS, fault_replay, healthy_run, record, write_csv
from rulec.simulation.equations import equations_of
from rulec.simulation.simulate import simulate_with
from tests.bench.conftest import Results
from tests.bench.rigs import side_by_side
from tests.bench.test_plan import BLOCK, block, by_lambdify, in_blocks, nanoseconds
from tests.conftest import compiled
from tests.rig.follower.plants import Planted, recorded

MILLION = 1_000_000
LONG = 100_000
MANY = 10_000
ROUNDS = 3
CHUNKED = 65_536
POLE = 1e3
EVERYTHING = ("R:", "u:", "x:", "ux:")
"""Residuals, degrees of all forms of rules, and the uncertainties of both."""


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
    rig, readings = RIGS[plant](), []
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


def seconds(call: Callable[[], object], rounds: int = 1) -> float:
    """Least processor time: others on the machine make it longer, never shorter."""
    times = []
    for _ in range(rounds):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return min(times)


def peak() -> float:
    """Most memory used so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def test_a_million_samples_of_the_rig(tmp_path: Path, results: Results) -> None:
    """Everything switched on, in blocks; beside it lambdify(cse=True) in chunks, same values."""
    rules = compiled("mixing-rig")
    plan = rules.plan.select([n for n in rules.plan.outputs if n.startswith(EVERYTHING)])
    recording = tiled(mostly_healthy("mixing-rig", "D.clogging", tmp_path), MILLION)
    inputs = inputs_of(recording, rules)
    in_blocks(plan, block(inputs, 0, BLOCK), BLOCK)
    before = peak()
    ours = seconds(lambda: in_blocks(plan, inputs, MILLION))
    what = f"rig: plan, {len(plan.operations)} operations, {len(plan.outputs)} outputs"
    results.add(f"{what}: per residual and sample", nanoseconds(ours, MILLION, rules), "ns")
    results.add("    memory more than after the first block", peak() - before, "MB", 50.0)
    peer = _chunked_peer(plan, block(inputs, 0, CHUNKED))
    results.add("    lambdify(cse=True) in chunks of 8192, times ours", peer / ours, "")


def _chunked_peer(plan: Plan, inputs: dict[str, Any]) -> float:
    """Seconds for a million samples, from a part of them."""
    function = by_lambdify(plan)
    given = {name: inputs.get(name, np.nan) for name in plan.inputs}

    def chunked() -> None:
        for low in range(0, CHUNKED, 8192):
            function(*block(given, low, low + 8192).values())

    expected = plan.run(inputs)
    for name, values in zip(plan.outputs, function(*given.values()), strict=True):
        # Beside a pole of a degree (which is about 1) rounding grows without bound.
        pole = np.abs(expected[name]) > POLE
        same = pole | np.isclose(values, expected[name], rtol=1e-6, atol=1e-9, equal_nan=True)
        assert np.mean(same) > 0.999, (name, np.mean(same))
    return seconds(chunked) * MILLION / CHUNKED


@pytest.mark.parametrize(("plant", "fault"), [("abc", "A.leakage"), ("mixing-rig", "D.clogging")])
@pytest.mark.parametrize("call", [diagnose, trace])
def test_a_long_recording(
    plant: str, fault: str, call: Callable[..., Any], tmp_path: Path, results: Results
) -> None:
    """Healthy with faulty stretches; beside it the plan alone."""
    rules = compiled(plant)
    recording = tiled(mostly_healthy(plant, fault, tmp_path), LONG)
    names = [n for n in rules.plan.outputs if n.startswith(("R:", "u:", "q:", "s:"))]
    plan, inputs = rules.plan.select(names), inputs_of(recording, rules)
    alone = seconds(lambda: in_blocks(plan, inputs, LONG))
    found = seconds(lambda: call(recording, rules), ROUNDS if call is diagnose else 1)
    goal = 5.0 if call is diagnose else None
    key = f"{call.__name__}.{plant}.seconds"
    results.add(f"{call.__name__} {LONG} samples of {plant}", found, "s", goal, key)
    results.add("    times the plan that it rests on", found / alone, "")


def test_hundreds_of_findings(results: Results) -> None:
    """A fault that comes and goes with every second stretch, each time another one."""
    rules, random = compiled("abc"), np.random.default_rng(1)
    faults = [f.id for f in rules.faults if not f.in_sensor and f.lowest <= 0.3]
    firsts = range(100, MANY - 26, 26)
    planted = [Planted(faults[k % len(faults)], 0.3, a, a + 13) for k, a in enumerate(firsts)]
    recording = recorded(rules, MANY, planted, 1.0, random)
    found = diagnose(recording, rules).findings
    assert len(found) > 0.9 * len(planted)
    taken = seconds(lambda: diagnose(recording, rules), ROUNDS)
    results.add(
        f"diagnose {MANY} samples with {len(found)} findings", taken, "s", 1.5, "findings.seconds"
    )


def test_a_healthy_million(results: Results) -> None:
    """Plant abc at rest."""
    rules, random = compiled("abc"), np.random.default_rng(2)
    recording = tiled(recorded(rules, MANY, [], 1.0, random), MILLION)
    assert diagnose(recording, rules).findings == ()
    taken = seconds(lambda: diagnose(recording, rules), ROUNDS)
    results.add(f"diagnose {MILLION} healthy samples of abc", taken, "s", 3.0, "million.seconds")


@pytest.mark.parametrize(
    ("plant", "samples"), [("abc", LONG), ("mixing-rig", LONG), ("rigs", 1000)]
)
def test_simulating(plant: str, samples: int, tmp_path: Path, results: Results) -> None:
    """Inputs spread from 85 to 110 % of their references; `rigs` are 196 modules."""
    if plant == "rigs":
        (tmp_path / "plant.yaml").write_text(side_by_side(196), encoding="utf-8")
        rules = compile_plant(tmp_path)
    else:
        rules = compiled(plant)
    equations, random = equations_of(rules), np.random.default_rng(0)
    given = {
        s.id: s.offset + (s.reference - s.offset) * random.uniform(0.85, 1.1, samples)
        for s in equations.given_signals
    }
    taken = seconds(lambda: simulate_with(equations, given, {}))
    results.add(f"simulate {samples} operating points of {plant}", taken, "s")


def test_the_smallest_call(tmp_path: Path, results: Results) -> None:
    """40 samples of a plant of three modules: what a call costs beside its samples."""
    file = tmp_path / "abc.csv"
    rig = RIGS["abc"]()
    write_csv(file, record(fault_replay(rig, "A.leakage", (0.0, 0.3), hold=20), seed=3).readings)
    rules = compiled("abc")
    recording = read_recording(file, rules)
    found = diagnose(recording, rules)
    assert ["A.leakage"] == [f.fault.id for f in found.findings]
    results.add(
        "diagnose 40 samples of abc", 1e3 * seconds(lambda: diagnose(recording, rules), 15), "ms"
    )
