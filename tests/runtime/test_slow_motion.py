"""Slow motion is evidence, with an error that grows with the rate: readings here lag behind."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady.observe import observe, reason
from rulec_runtime.diagnosis.steady.points import points_of_stretches
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.slow_motion import lag_errors, lag_u, settle_or_slow
from rulec_runtime.recordings.stationary import Stretches, settle

from rulec.prove.truth import NOISE_FREE, RIGS, TABLE_1, Operation, Run, record
from rulec.prove.truth.runs import approach
from rulec.prove.truth.sensors import DOSING_SIGNALS, MIXER_SIGNALS, read
from tests.conftest import compiled
from tests.method.readings import recording

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
    rig, drawn = RIGS["abc"](), np.random.default_rng(seed)
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
        table = DOSING_SIGNALS if place.split(".")[0] in rig.modules else MIXER_SIGNALS
        sensor = table[place.split(".")[1]]
        late = approach(time, values * sensor.scale + sensor.offset, drawn.uniform(0.05, lag))
        readings[title] = read(sensor, place, late, TABLE_1, seed)
    moves = np.concatenate([[False], np.diff(part) != 0])
    return Made(recording(compiled("abc"), readings), moves)


def judged(one: Made) -> np.ndarray:
    """Which samples have a verdict."""
    return np.array([w != "moving" for w in trace(one.recording, compiled("abc")).verdict])


@pytest.mark.parametrize("seconds", [60, 15])
def test_a_fault_during_a_slow_ramp_is_found(seconds: int) -> None:
    """A leak that is there on the way alone; while only settled samples counted it was missed."""
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
    """At any rate, with readings that lag up to twice as much as is assumed."""
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
    rate = 0.3 * RIGS["abc"]().modules["A"].speed / 30
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
    """No estimate is used whose flow may be off by more than a tenth."""
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
