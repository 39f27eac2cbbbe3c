"""Slow motion is evidence, with an error that grows with the rate; noise of a mean."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady.evaluated_points import evaluate_stretches
from rulec_runtime.diagnosis.steady.observe import observe, reason
from rulec_runtime.diagnosis.steady.points import points_of_stretches
from rulec_runtime.diagnosis.steady.redundancy import covariance_of, residual_basis
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.slow_motion import lag_errors, lag_u, settle_or_slow
from rulec_runtime.recordings.stationary import Stretches, settle

from rulec.prove.truth.sensors import read
from rulec.prove.truth.settled.drive import approach
from tests.conftest import compiled
from tests.dosing import (
    INSIDE,
    NOISE_FREE,
    RIGS,
    TABLE_1,
    Operation,
    Run,
    healthy_run,
    operating_points,
    record,
    visiting_run,
)
from tests.method.readings import built, recording, ruleset

HOLD = 30
LEAK = 0.2


@dataclass(frozen=True)
class Made:
    """A recording of abc whose speeds go up and down; `ramps` flags its samples on the way."""

    recording: Recording
    ramps: np.ndarray


def made(seconds: int, seed: int, lag: float, leak_on_first: bool = False) -> Made:
    """Speeds of A and B move by 30 % against each other within some seconds, four times.

    Lags of all readings are drawn between 0 and `lag`, s.
    """
    rig, drawn = RIGS["abc"], np.random.default_rng(seed)
    way = np.linspace(-0.15, 0.15, seconds + 1)[1:]
    there = np.concatenate([np.full(HOLD, way[0]), way, np.full(HOLD, way[-1]), way[::-1]])
    part = np.concatenate([there, there, np.full(HOLD, way[0])])
    n = len(part)
    speed = {
        name: module.speed * (1.0 + sign * part)
        for sign, (name, module) in zip((1.0, -1.0), rig.modules.items(), strict=True)
    }
    degree = np.zeros(n)
    degree[HOLD : HOLD + seconds] = LEAK * leak_on_first
    faults = {"A.leakage": degree} if leak_on_first else {}
    time = np.arange(n, dtype=float)
    exact = record(Run(rig, Operation(time, speed), faults), NOISE_FREE).readings
    readings: dict[str, Array] = {"time [s]": time}
    for title, values in exact.items():
        if title == "time [s]":
            continue
        place = title.split(" ")[0]
        sensor = rig.rig.sensors[place]
        late = approach(time, values * sensor.scale + sensor.offset, drawn.uniform(0.05, lag))
        readings[title] = read(sensor, place, late, TABLE_1, seed)
    moves = np.concatenate([[False], np.diff(part) != 0])
    return Made(recording(compiled("abc"), readings), moves)


def judged(one: Made) -> np.ndarray:
    return np.array([w != "moving" for w in trace(one.recording, compiled("abc")).verdict])


@pytest.mark.parametrize("seconds", [60, 15])
def test_a_fault_during_a_slow_ramp_is_found(seconds: int) -> None:
    one = made(seconds, 1, 0.6, leak_on_first=True)
    named = diagnose(one.recording, compiled("abc")).findings
    assert ["A.leakage"] == [f.fault.id for f in named]
    assert named[0].lower <= LEAK <= named[0].upper
    assert HOLD - 1 <= named[0].since
    assert named[0].until <= HOLD + seconds
    assert judged(one)[one.ramps].mean() > 0.5


@pytest.mark.parametrize("seconds", [200, 60, 30, 15, 8])
@pytest.mark.parametrize("lag", [0.1, 2.0])
def test_a_healthy_ramp_raises_no_alarm(seconds: int, lag: float) -> None:
    found = diagnose(made(seconds, 11, lag).recording, compiled("abc"))
    assert () == (*found.findings, *found.unknown)


def test_a_step_is_not_judged() -> None:
    """Speeds that change within three samples are gone before anything can be said."""
    one = made(3, 1, 0.6)
    assert not judged(one)[one.ramps].any()
    rules = compiled("abc")
    both = (find(one.recording, rules)[0] for find in (settle, settle_or_slow))
    first, second = (np.stack([s.first, s.last]) for s in both)
    assert np.array_equal(first, second)


def test_the_error_by_a_lag_has_the_sign_of_the_rate_and_lasts() -> None:
    """Up and down are opposite; two ramps up are the same, so that more of them average nothing."""
    one, rules = made(30, 1, 0.6), compiled("abc")
    stretches, noise = settle_or_slow(one.recording, rules)
    errors = lag_errors(one.recording, rules, stretches, noise)["A.n"]
    up = errors[(stretches.first > HOLD + 2) & (stretches.last < HOLD + 28)]
    down = errors[(stretches.first > 3 * HOLD + 2 + 30) & (stretches.last < 2 * HOLD + 58 + 30)]
    rate = 0.3 * RIGS["abc"].modules["A"].speed / 30
    expected = lag_u(one.recording) * rate
    assert up == pytest.approx(expected, rel=0.25)
    assert down == pytest.approx(-expected, rel=0.25)
    observed = observe(rules, points_of_stretches(one.recording, rules, stretches, noise))
    ramp = int(np.argmax(errors))
    lasting = observed.covariance[ramp] - observed.noise[ramp]
    rest = int(np.flatnonzero(errors == 0.0)[0])
    assert lasting[0, 0] > 2.0 * (observed.covariance[rest] - observed.noise[rest])[0, 0]


def test_where_nothing_moves_nothing_is_added() -> None:
    """The noise of a settled recording is no rate; the level of a tank falls all the time."""
    one, rules = made(30, 1, 0.1), compiled("abc")
    stretches, noise = settle(one.recording, rules)
    rests = Stretches(stretches.first[:1] + 5, stretches.last[:1] - 5)
    assert set(lag_errors(one.recording, rules, rests, noise)).isdisjoint(rules.observed)


def test_estimates_that_lags_may_spoil_are_not_used() -> None:
    one, rules = made(8, 1, 0.6), compiled("abc")
    stretches, noise = settle_or_slow(one.recording, rules)
    points = points_of_stretches(one.recording, rules, stretches, noise)
    assert observe(rules, points).valid.all()
    quick = replace(points, lag={name: 4.0 * e for name, e in points.lag.items()})
    observed = observe(rules, quick)
    lost = np.argwhere(~observed.valid)
    assert len(lost)
    for observer, point in lost:
        assert reason(rules, observed, int(observer), int(point)).endswith("change too fast")
    lasting = [np.diag(c - n) for c, n in zip(observed.covariance, observed.noise, strict=True)]
    share = np.sqrt(np.array(lasting).T) / observed.flows
    assert share[observed.valid].max() < 1.2 * limits.TOO_FAST


SAMPLES = 40


def healthy(seed: int) -> Recording:
    made = record(healthy_run(built("abc"), SAMPLES), INSIDE, seed)
    return recording(ruleset("abc"), made.readings)


def with_course(plain: Recording, signal: str, course: Array) -> Recording:
    values = plain.values[signal]
    return replace(plain, values={**plain.values, signal: values + course * np.mean(values)})


def added(made: Recording) -> float:
    """Of two stretches: variance of the residuals by what halves differ, over that by noise."""
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
    plant, rules = built("abc"), ruleset("abc")
    points = operating_points(plant, 2)
    slow = [
        {m: points[0][m] * (1.0 - share) + points[1][m] * share for m in points[0]}
        for share in np.linspace(0.0, 0.2, SAMPLES)
    ]
    run = visiting_run(plant, slow, {}, 0, 1)
    made = [recording(rules, record(run, INSIDE, seed).readings) for seed in range(10)]
    assert np.mean([added(one) for one in made]) < 1.0
