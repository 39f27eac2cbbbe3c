"""Leakage in A in plateaus, with the noise of Table 1 (method.md, section 4, claim 16)."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady.isolate import isolate
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.paper_mode import judge_by_paper
from rulec_runtime.diagnosis.steady.points import points_of_samples
from rulec_runtime.recordings.stationary import noise_of

from rulec.prove.truth import TABLE_1, leakage_replay, record
from tests.method.readings import built, recording, ruleset

SEEDS = range(1, 21)
FAULT = "A.leakage"


@dataclass(frozen=True)
class Replay:
    """All samples of all seeds: true degree, and per mode degree, bounds, whether named."""

    true: Array
    default: Array
    default_u: Array
    default_named: Array
    default_alarm: Array
    paper: Array
    paper_lower: Array
    paper_upper: Array
    paper_named: Array


@functools.cache
def replay() -> Replay:
    """Every sample judged on its own."""
    rules = ruleset("abc")
    index = [f.id for f in rules.faults].index(FAULT)
    parts = []
    for seed in SEEDS:
        made = record(leakage_replay(built("abc")), TABLE_1, seed)
        readings = recording(rules, made.readings)
        noise = {name: noise_of(values) for name, values in readings.values.items()}
        observed = observe(rules, points_of_samples(readings, rules, noise))
        isolation, paper = isolate(rules, observed), judge_by_paper(rules, observed)
        best = np.argmax(isolation.probability, axis=0)
        parts.append((
            made.truth[f"{FAULT} [1]"], isolation.degree[index], isolation.u[index],
            isolation.deviating & (best == index), isolation.deviating,
            paper.degree[index], paper.lower[index], paper.upper[index], paper.winner() == index,
        ))  # fmt: skip
    return Replay(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def figures() -> dict[str, float]:
    """The figures of claim 16, over samples with a leakage."""
    r = replay()
    on = r.true > 0
    default, paper = (r.default - r.true)[on], (r.paper - r.true)[on]
    return {
        "default mean |error|": float(np.abs(default).mean()),
        "default bias": float(default.mean()),
        "default in 95 % bounds": float(np.mean(np.abs(default) <= 2 * r.default_u[on])),
        "paper mean |error|": float(np.abs(paper).mean()),
        "paper bias": float(paper.mean()),
        "paper in bounds": float(
            np.mean((r.paper_lower[on] <= r.true[on]) & (r.true[on] <= r.paper_upper[on]))
        ),
        "paper below lower bound": float(np.mean(r.true[on] < r.paper_lower[on])),
    }


def test_default_mode() -> None:
    """Every leaking sample is named, the degree unbiased, no healthy sample alarms."""
    found, r = figures(), replay()
    assert r.default_named[r.true > 0].all()
    assert not r.default_alarm[r.true == 0].any()
    assert found["default mean |error|"] < 0.01
    assert abs(found["default bias"]) < 0.005
    assert found["default in 95 % bounds"] > 0.9


def test_paper_mode() -> None:
    """The minimum of noisy rules is biased low; its error is that of the publication."""
    found, r = figures(), replay()
    assert r.paper_named[r.true > 0].mean() > 0.99
    assert 0.015 < found["paper mean |error|"] < 0.030
    assert -0.030 < found["paper bias"] < -0.015
    assert found["paper in bounds"] > 0.9
    assert 0.0 == found["paper below lower bound"]


def test_whole_recording() -> None:
    """The plateaus come out as three findings with their degrees."""
    rules = ruleset("abc")
    for seed in list(SEEDS)[:5]:
        made = record(leakage_replay(built("abc")), TABLE_1, seed)
        found = diagnose(recording(rules, made.readings), rules).findings
        assert [FAULT] * 3 == [f.fault.id for f in found]
        errors = np.array([f.degree for f in found]) - [0.2, 0.4, 0.6]
        assert np.abs(errors).max() < 0.015
        for finding, true in zip(found, (0.2, 0.4, 0.6), strict=True):
            assert finding.lower - 0.002 <= true <= finding.upper + 0.002
