"""The baseline: lasting errors learned from fault-free stretches, forgotten slowly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.baseline import nothing_learned, remembered
from rulec_runtime.diagnosis.steady.learn_baseline import Learner
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.points import points_of_stretches
from rulec_runtime.diagnosis.steady.redundancy import residual_basis
from rulec_runtime.recordings.stationary import find_stretches, noise_at_work

from rulec.prove.truth import TABLE_1, Run, Sensing, healthy_run, record
from tests.method.readings import built, recording, ruleset

LEAD = 20
SAMPLES = 40


def with_fault(fault: str, degree: float, seed: int, lead: int = LEAD) -> Diagnosis:
    rules = ruleset("abc")
    run = healthy_run(built("abc"), SAMPLES)
    degrees = np.where(run.operation.time >= lead, degree, 0.0)
    made = record(Run(run.plant, run.operation, {fault: degrees}), TABLE_1, seed)
    return diagnose(recording(rules, made.readings), rules)


def test_learning_in_turn_is_learning_at_once_and_is_forgotten() -> None:
    """The recursion equals conditioning on all stretches together, drift included. After many times
    the memory, errors are as uncertain as before anything."""
    rules = ruleset("abc")
    made = recording(rules, record(healthy_run(built("abc"), 175), TABLE_1, 1).readings)
    noise = noise_at_work(made, rules)
    stretches = find_stretches(made, rules, noise)
    observed = observe(rules, points_of_stretches(made, rules, stretches, noise))
    last = Learner(rules, keep=True).take(observed, 0).states[-1]
    learned = list(last.points)
    assert len(learned) > 1
    basis = residual_basis(rules, observed.valid[:, 0])
    gradients = np.vstack([basis @ observed.shared[:, :, k] for k in learned])
    assert observed.points.time is not None
    time = observed.points.time[learned]
    rank = len(basis)
    each = np.repeat(time, rank)
    total = gradients @ gradients.T * remembered(each[:, None] - each)
    for row, k in enumerate(learned):
        block = slice(row * rank, (row + 1) * rank)
        total[block, block] += basis @ observed.noise[k] @ basis.T
    residuals = np.concatenate([basis @ observed.flows[:, k] for k in learned])
    crossed = (gradients * remembered(each - time[-1])[:, None]).T
    gain = np.linalg.solve(total, crossed.T).T
    assert np.allclose(gain @ residuals, last.mean, atol=1e-6)
    expected = np.eye(len(crossed)) - gain @ crossed.T
    assert np.allclose(expected, last.covariance, atol=1e-6)
    blank = nothing_learned(observed)
    known = replace(blank, mean=blank.mean + 1.0, covariance=0.01 * blank.covariance)
    late = known.later(20 * limits.LASTING)
    assert np.allclose(blank.mean, late.mean, atol=1e-6)
    assert np.allclose(blank.covariance, late.covariance, atol=1e-6)


@pytest.mark.prove
def test_bounds_hold_the_truth() -> None:
    """100 recordings, leakage of 0.3 behind a healthy start: 95 % bounds, unit scatter."""
    off, inside = [], []
    for seed in range(100):
        (finding,) = with_fault("A.leakage", 0.3, 7000 + seed).findings
        half = 0.5 * (finding.upper - finding.lower)
        off.append((finding.degree - 0.3) / (0.5 * half))
        inside.append(finding.lower <= 0.3 <= finding.upper)
    assert 0.90 <= np.mean(inside) <= 0.99
    assert 0.8 < np.std(off) < 1.2
    assert abs(np.mean(off)) < 0.3


def test_a_healthy_start_narrows_the_bounds() -> None:
    (late,), (always,) = (with_fault("A.leakage", 0.3, 1, lead).findings for lead in (LEAD, 0))
    assert always.upper - always.lower > 3 * (late.upper - late.lower)
    assert (1, 0) == (late.baseline, always.baseline)


@pytest.mark.parametrize("fault", ["A.clogging", "A.dp.high", "B.widening", "B.dp.low"])
def test_a_healthy_start_separates_what_looks_alike(fault: str) -> None:
    """A stiff pump's line and its pressure sensor, degree 0.2, one operating point."""
    for seed in range(2):
        (finding,) = with_fault(fault, 0.2, 7200 + seed).findings
        assert fault == finding.fault.id
        # At one operating point a share of a reading and a size look the same.
        others = {name.replace(".offset.", ".") for name, _ in finding.alternatives}
        assert others <= {fault}


def test_a_fault_too_small_to_see_at_first_is_dated_back() -> None:
    """A power meter 30 % high from the start at a low load, where its bounds hide it: found at
    higher speed, and said to have been there from the first stretch on, if anything is said."""
    rules, run = ruleset("abc"), healthy_run(built("abc"), 60)
    share, said = np.where(run.operation.time < 30, 0.45, 1.3), 0
    operation = replace(run.operation, speed={n: share * v for n, v in run.operation.speed.items()})
    faulty = replace(run, operation=operation, faults={"A.P_el.high": np.full(60, 0.12)})
    for seed in range(8):
        made = record(faulty, Sensing(), seed)
        found = diagnose(recording(rules, made.readings), rules).findings
        said += bool(found)
        assert {"A.P_el.high"} >= {f.fault.id for f in found}
    assert said > 0
