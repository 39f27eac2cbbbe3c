"""Degrees grow with the fault (method.md, claim 20)."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.isolate import isolate
from rulec_runtime.diagnosis.steady.observe import Observed, observe
from rulec_runtime.diagnosis.steady.paper_mode import judge_by_paper

from tests.method.readings import PUMPS, evaluate, noise_free, points, ruleset

REACH = {"leakage": 0.95, "clogging": 2.5, "widening": 0.75, "high": 1.2, "low": 0.7}
"""Largest degree of a sweep, before the poles of the linear rules."""
SHORTER = {
    ("abc", "A.dp.low"): 0.68,  # the slope of the line goes to infinity at its static part
    ("abc-membrane", "A.dp.low"): 0.57,
    ("abc-centrifugal", "A.dp.low"): 0.59,
    ("abc-centrifugal", "A.dp.high"): 0.05,  # shut-off comes at 0.08
    ("abc-membrane", "A.dp.high"): 1.1,
    ("abc-centrifugal", "C.dp.high"): 1.1,
}
"""Where linear rules turn back earlier."""
RIVAL_ENDS = {("abc-membrane", "A.dp.high"): 1.06}
"""Degree at which the winner of Eq. 17, a clogging there, leaves its range and counts as 0."""
FAULTS = (
    "A.leakage", "A.clogging", "A.widening", "A.dp.high", "A.dp.low", "A.P_el.high", "A.P_el.low",
    "C.clogging", "C.widening", "C.dp.high", "C.dp.low",
)  # fmt: skip
SWEEPS = [(plant, fault) for plant in PUMPS for fault in FAULTS]


def sweep(plant: str, fault: str, points: int = 25) -> Array:
    """True degrees from small to large."""
    top = SHORTER.get((plant, fault), REACH[fault.rsplit(".", 1)[1]])
    return np.linspace(0.0, top, points)[1:]


@functools.cache
def watched(plant: str, fault: str) -> Observed:
    """Observers at each degree of a sweep, without noise."""
    rules = ruleset(plant)
    observed = observe(rules, points(rules, noise_free(plant, fault, sweep(plant, fault))))
    assert observed.valid.all()
    return observed


def row(plant: str, fault: str) -> int:
    """Row of a fault in the tables of results."""
    return [f.id for f in ruleset(plant).faults].index(fault)


def grows(x: Array) -> bool:
    """Never falls, apart from rounding."""
    return bool(np.all(np.diff(x) >= -1e-9))


@pytest.mark.parametrize(("plant", "fault"), SWEEPS)
def test_every_rule_grows(plant: str, fault: str) -> None:
    """Each rule of the true fault, in each of its forms."""
    rules = ruleset(plant)
    found = evaluate(rules, noise_free(plant, fault, sweep(plant, fault)))
    for cell in rules.cells_of_fault[fault]:
        for form in cell.forms:
            x = found[f"x:{form}:{fault}:{cell.residual}"]
            assert grows(x[x < 20]), f"{form} {cell.residual}"


@pytest.mark.parametrize(("plant", "fault"), SWEEPS)
def test_equation_17_grows(plant: str, fault: str) -> None:
    """Eq. 17: the smallest degree of the true fault, and the largest over all faults.

    The largest may fall once, where a wrong fault has been named up to its range and the true one
    takes over.
    """
    result, true = judge_by_paper(ruleset(plant), watched(plant, fault)), sweep(plant, fault)
    assert grows(result.degree[row(plant, fault)])
    below = true <= RIVAL_ENDS.get((plant, fault), np.inf)
    assert grows(result.degree.max(axis=0)[below])
    assert np.all(result.winner()[~below] == row(plant, fault))


@pytest.mark.parametrize(("plant", "fault"), SWEEPS)
def test_default_mode_finds_the_degree(plant: str, fault: str) -> None:
    """Where a deviation is seen, the fitted degree is the true one, so it grows too."""
    true, index = sweep(plant, fault), row(plant, fault)
    isolation = isolate(ruleset(plant), watched(plant, fault))
    seen = isolation.deviating
    assert grows(seen.astype(float))
    assert true[seen] == pytest.approx(isolation.degree[index, seen], rel=1e-3)
    assert np.all(isolation.probability[index, seen] > 0)


def far(plant: str, fault: str, true: list[float]) -> tuple[Array, list[str]]:
    """Fitted degrees of a fault, and the faults named."""
    rules = ruleset(plant)
    isolation = isolate(rules, observe(rules, points(rules, noise_free(plant, fault, true))))
    named = [rules.faults[i].id for i in np.argmax(isolation.probability, axis=0)]
    return isolation.degree[row(plant, fault)], named


LARGE = {"clogging": [3.0, 8.0], "high": [1.5, 3.0]}
"""Large degrees; 80 and 90 % of all others."""


@pytest.mark.parametrize("fault", [f for f in FAULTS if f != "A.dp.low"])
def test_default_mode_finds_large_degrees(fault: str) -> None:
    """Far from where Gauss-Newton starts, too."""
    true = LARGE.get(fault.rsplit(".", 1)[1], [0.8, 0.9])
    degree, named = far("abc", fault, true)
    assert true == pytest.approx(degree, rel=1e-3)
    assert [fault] * 2 == named


@pytest.mark.parametrize(
    ("plant", "fault", "true"),
    [("abc", "A.dp.low", [0.8, 0.9]), ("abc-membrane", "A.widening", [0.95])],
)
def test_tolerance_does_not_turn_against_large_degrees(
    plant: str, fault: str, true: list[float]
) -> None:
    """The hypothesis that leaves no residual at all is the most probable one."""
    degree, named = far(plant, fault, true)
    assert true == pytest.approx(degree, rel=1e-3)
    assert [fault] * len(true) == named
