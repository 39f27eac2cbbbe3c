"""Noise of a mean: that of the stretches, and what a reading does in them beyond it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady.evaluated_points import evaluate_stretches
from rulec_runtime.diagnosis.steady.redundancy import covariance_of, residual_basis
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Stretches, settle

from rulec.prove.truth import INSIDE, healthy_run, operating_points, record, visiting_run
from tests.method.readings import built, recording, ruleset

FLOW = "A.Q"
SAMPLES = 40


def healthy(seed: int) -> Recording:
    """One operating point, sensors within their bounds."""
    made = record(healthy_run(built("abc"), SAMPLES), INSIDE, seed)
    return recording(ruleset("abc"), made.readings)


def with_course(plain: Recording, signal: str, course: Array) -> Recording:
    """The recording with something added to a reading, as share of its mean."""
    values = plain.values[signal]
    return replace(plain, values={**plain.values, signal: values + course * np.mean(values)})


def added(made: Recording) -> float:
    """Variance of the residuals of two stretches by what their halves differ, over that by noise:
    the mean over all directions, of the stretch with more."""
    rules, half = ruleset("abc"), SAMPLES // 2
    stretches = Stretches(np.array([0, half]), np.array([half, SAMPLES]))
    (seen,) = evaluate_stretches(made, rules, stretches, settle(made, rules)[1], "default")
    every = np.arange(2)
    basis = residual_basis(rules, seen.plain.valid[:, 0])
    wander = covariance_of(basis, seen.plain.wander, seen.plain.valid[:, 0], every)
    noise = covariance_of(basis, seen.plain.noise, seen.plain.valid[:, 0], every) - wander
    return float(np.max(np.einsum("nii->n", np.linalg.solve(noise, wander))) / len(basis))


def test_noise_is_that_of_the_stretches_not_of_the_steps_between_them() -> None:
    """Ten samples at each of eight points: a tenth of all samples moves, the noise stays."""
    plant, rules = built("abc"), ruleset("abc")
    run = visiting_run(plant, operating_points(plant, 8), {}, 10, 10)
    moved = [recording(rules, record(run, INSIDE, seed).readings) for seed in range(10)]
    still, found = (
        {n: np.mean([settle(r, rules)[1][n] for r in made]) for n in ("A.n", "A.dp", "A.P_el")}
        for made in ([healthy(seed) for seed in range(10)], moved)
    )
    for name, expected in still.items():
        assert found[name] == pytest.approx(expected, rel=0.2)


def test_a_reading_that_still_settles_is_known_less_well() -> None:
    """Power that is 15 % off and returns within a stretch raises no alarm; held it does."""
    seconds = np.arange(float(SAMPLES))
    decay = np.where(seconds >= 20, 0.15 * np.exp(-(seconds - 20) / 6.0), 0.0)
    plain = healthy(3)
    wandering = with_course(plain, "A.P_el", decay)
    assert added(wandering) > 5.0
    held = with_course(plain, "A.P_el", np.where(seconds >= 20, 0.15, 0.0))
    assert "ok" == diagnose(wandering, ruleset("abc")).status
    assert ["A.P_el.high"] == [f.fault.id for f in diagnose(held, ruleset("abc")).findings]


def test_the_course_of_the_plant_is_no_noise() -> None:
    """A pump that slowly runs up moves all estimates together."""
    plant, rules = built("abc"), ruleset("abc")
    points = operating_points(plant, 2)
    slow = [
        {m: points[0][m] * (1.0 - share) + points[1][m] * share for m in points[0]}
        for share in np.linspace(0.0, 0.2, SAMPLES)
    ]
    run = visiting_run(plant, slow, {}, 0, 1)
    made = [recording(rules, record(run, INSIDE, seed).readings) for seed in range(10)]
    assert np.mean([added(one) for one in made]) < 1.0
