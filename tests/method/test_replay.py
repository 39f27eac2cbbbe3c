"""Leakage in A in plateaus, with the noise of Table 1 (method.md, section 4, claim 16)."""

from __future__ import annotations

import functools
from collections import defaultdict

import numpy as np
import pytest
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


@functools.cache
def replay() -> dict[str, Array]:
    """Every sample of all seeds judged on its own: its true degree, and per mode error, doubt and
    what is named."""
    rules = ruleset("abc")
    index = [f.id for f in rules.faults].index(FAULT)
    parts: dict[str, list[Array]] = defaultdict(list)
    for seed in SEEDS:
        made = record(leakage_replay(built("abc")), TABLE_1, seed)
        readings = recording(rules, made.readings)
        noise = {name: noise_of(values) for name, values in readings.values.items()}
        observed = observe(rules, points_of_samples(readings, rules, noise))
        isolation, paper = isolate(rules, observed), judge_by_paper(rules, observed)
        best, true = np.argmax(isolation.probability, axis=0), made.truth[f"{FAULT} [1]"]
        for name, column in {
            "true": true,
            "error": isolation.degree[index] - true,
            "u": isolation.u[index],
            "named": isolation.deviating & (best == index),
            "alarm": isolation.deviating,
            "paper error": paper.degree[index] - true,
            "below": true < paper.lower[index],
            "above": true > paper.upper[index],
            "paper named": paper.winner() == index,
        }.items():
            parts[name].append(column)
    return {name: np.concatenate(columns) for name, columns in parts.items()}


def test_default_mode() -> None:
    """Every leaking sample is named, the degree unbiased, no healthy sample alarms."""
    r = replay()
    on = r["true"] > 0
    assert r["named"][on].all()
    assert not r["alarm"][~on].any()
    assert np.abs(r["error"][on]).mean() < 0.01
    assert abs(r["error"][on].mean()) < 0.005
    assert np.mean(np.abs(r["error"]) <= 2 * r["u"], where=on) > 0.9


def test_paper_mode() -> None:
    """The minimum of noisy rules is biased low; its error is that of the publication."""
    r = replay()
    on = r["true"] > 0
    assert r["paper named"][on].mean() > 0.99
    assert 0.015 < np.abs(r["paper error"][on]).mean() < 0.030
    assert -0.030 < r["paper error"][on].mean() < -0.015
    assert np.mean(~r["below"] & ~r["above"], where=on) > 0.9
    assert not r["below"][on].any()


def test_whole_recording() -> None:
    """The plateaus come out as three findings with their degrees."""
    rules = ruleset("abc")
    for seed in list(SEEDS)[:5]:
        made = record(leakage_replay(built("abc")), TABLE_1, seed)
        found = diagnose(recording(rules, made.readings), rules).findings
        assert [FAULT] * 3 == [f.fault.id for f in found]
        for finding, true in zip(found, (0.2, 0.4, 0.6), strict=True):
            assert true == pytest.approx(finding.degree, abs=0.015)
            assert finding.lower - 0.002 <= true <= finding.upper + 0.002
