"""Isolation rates and false alarms with the noise of Table 1 (method.md, section 2, claim 15)."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady.isolate import isolate
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.paper_mode import judge_by_paper

from rulec.prove.truth import TABLE_1, healthy_run, record
from tests.method.readings import PUMPS, built, noise_free, noisy, points, recording, ruleset

SEEDS = 30
MENTION = 0.02
"""Faults more probable than this are shown to the operator."""


@dataclass(frozen=True)
class Rates:
    """Shares over all faults and seeds.

    `named`: the most probable fault is the true one. `shared`: the true fault is among the s
    faults mentioned, counted 1/s. `possible`: it is mentioned. `silent`: no alarm. `paper`: Eq. 17.
    """

    named: float
    shared: float
    possible: float
    silent: float
    paper: float


@functools.cache
def rates(
    plant: str, degree: float, seeds: int = SEEDS, skip: frozenset[str] = frozenset()
) -> Rates:
    """One operating point, new sensor errors of half their bound for every seed."""
    rules, random = ruleset(plant), np.random.default_rng(17)
    names = [f.id for f in rules.faults]
    asked = [i for i, name in enumerate(names) if name not in skip]
    parts = [noisy(rules, noise_free(plant, names[i], degree), seeds, random) for i in asked]
    values = {signal: np.concatenate([p[signal] for p in parts]) for signal in parts[0]}
    true = np.repeat(asked, seeds)
    observed = observe(rules, points(rules, values))
    chances = isolate(rules, observed).probability
    column = np.arange(true.size)
    mentioned = chances > MENTION
    possible = mentioned[true, column]
    size = np.maximum(mentioned.sum(axis=0), 1)
    some = chances.max(axis=0) > 0
    paper = judge_by_paper(rules, observed)
    return Rates(
        named=float(np.mean(some & (np.argmax(chances, axis=0) == true))),
        shared=float(np.mean(possible / size)),
        possible=float(np.mean(possible)),
        silent=float(np.mean(~some)),
        paper=float(np.mean((paper.winner() == true) & (paper.degree.max(axis=0) > 0))),
    )


@pytest.mark.parametrize(
    ("degree", "named", "possible"), [(0.1, 0.57, 0.75), (0.2, 0.82, 0.93), (0.3, 0.92, 0.98)]
)
def test_default_mode_isolates(degree: float, named: float, possible: float) -> None:
    """Two progressive cavity pumps; at 0.1 the power readings stay below their threshold."""
    found = rates("abc", degree)
    assert named < found.named
    assert possible < found.possible


def test_what_is_seen_is_not_mislabelled() -> None:
    """Where an alarm is given, the true fault is among those mentioned."""
    for degree in (0.1, 0.2, 0.3):
        found = rates("abc", degree)
        assert found.possible / (1 - found.silent) > 0.99


@pytest.mark.parametrize(("degree", "printed"), [(0.1, 0.61), (0.2, 0.66), (0.3, 0.67)])
def test_equation_17_isolates_as_method_md_says(degree: float, printed: float) -> None:
    """Literal Eq. 17 on the same readings."""
    assert printed == pytest.approx(rates("abc", degree).paper, abs=0.06)


def test_healthy_points_do_not_alarm() -> None:
    """Claim 15: none of 2000 fault-free samples with the gate of the default mode."""
    rules = ruleset("abc")
    values = noisy(rules, noise_free("abc"), 2000, np.random.default_rng(15))
    observed = observe(rules, points(rules, values))
    assert 0 == isolate(rules, observed).deviating.sum()
    assert np.mean(judge_by_paper(rules, observed).degree.max(axis=0) > 0) > 0.99


def test_healthy_recordings_have_no_findings() -> None:
    """Ten recordings, ten sets of sensor errors."""
    rules = ruleset("abc")
    for seed in range(1, 11):
        made = record(healthy_run(built("abc")), TABLE_1, seed)
        found = diagnose(recording(rules, made.readings), rules)
        remarks = found.findings + found.unknown + found.not_judged
        assert ("ok", ()) == (found.status, remarks)


@pytest.mark.parametrize("plant", PUMPS)
def test_paper_mode_gives_few_false_alarms(plant: str) -> None:
    """method.md, section 2: 1.3 to 2.8 % with a gate on all relevant residuals at 2 sigma.

    Bounds are three standard errors of 2000 samples wider.
    """
    rules = ruleset(plant)
    values = noisy(rules, noise_free(plant), 2000, np.random.default_rng(15))
    result = judge_by_paper(rules, observe(rules, points(rules, values)))
    assert 0.005 < np.mean(result.deviating) < 0.039


@pytest.mark.parametrize("fault", ["A.leakage", "A.dp.low", "C.clogging"])
def test_paper_mode_asks_for_all_rules_of_the_winner(fault: str) -> None:
    """Section 3.6.4 of the seed paper: all residuals of the named fault beyond 2 u, or none."""
    rules = ruleset("abc")
    values = noisy(rules, noise_free("abc", fault, 0.1), 300, np.random.default_rng(36))
    observed = observe(rules, points(rules, values))
    result = judge_by_paper(rules, observed)
    place = {r.id: i for i, r in enumerate(rules.residuals)}
    fires = np.abs(observed.residuals) > 2 * observed.residual_u
    expected = []
    for point, winner in enumerate(result.winner()):
        own = [place[c.residual] for c in rules.cells_of_fault[rules.faults[winner].id]]
        expected.append(fires[own, point].all() and result.degree[winner, point] > 0)
    assert 0 < sum(expected) < 300
    assert expected == result.deviating.tolist()
