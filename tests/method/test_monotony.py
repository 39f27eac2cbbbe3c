"""Degrees grow with the fault (method.md, claim 20)."""

import numpy as np
import pytest
from rulec_runtime.diagnosis.steady.isolate import isolate
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.paper_mode import judge_by_paper

from tests.method.readings import PUMPS, noise_free, points, ruleset

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
FAULTS = (
    "A.leakage", "A.clogging", "A.widening", "A.dp.high", "A.dp.low", "A.P_el.high", "A.P_el.low",
    "C.clogging", "C.widening", "C.dp.high", "C.dp.low",
)  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("plant", PUMPS)
def test_degrees_grow(plant: str, fault: str) -> None:
    """By Eq. 17 the smallest degree of the true fault. In the default mode a deviation stays seen,
    and the fitted degree is the true one."""
    rules, own = ruleset(plant), row(plant, fault)
    top = SHORTER.get((plant, fault), REACH[fault.rsplit(".", 1)[1]])
    true = np.linspace(0.0, top, 25)[1:]
    observed = observe(rules, points(rules, noise_free(plant, fault, true)))
    assert observed.valid.all()
    assert np.all(np.diff(judge_by_paper(rules, observed).degree[own]) >= -1e-9)
    isolation = isolate(rules, observed)
    seen = isolation.deviating
    assert np.all(np.diff(seen.astype(int)) >= 0)
    assert true[seen] == pytest.approx(isolation.degree[own, seen], rel=1e-3)
    assert np.all(isolation.probability[own, seen] > 0)


def row(plant: str, fault: str) -> int:
    """Row of a fault in the tables of results."""
    return [f.id for f in ruleset(plant).faults].index(fault)


LARGE = {
    **{("abc", fault): [0.8, 0.9] for fault in FAULTS},
    **{("abc", f"{module}.clogging"): [3.0, 8.0] for module in "AC"},
    **{("abc", fault): [1.5, 3.0] for fault in FAULTS if fault.endswith("high")},
    ("abc-membrane", "A.widening"): [0.95],
}


@pytest.mark.parametrize(("plant", "fault"), LARGE)
def test_default_mode_finds_large_degrees(plant: str, fault: str) -> None:
    """Far from where Gauss-Newton starts, too: the hypothesis that leaves no residual at all is the
    most probable one."""
    rules, true = ruleset(plant), LARGE[plant, fault]
    isolation = isolate(rules, observe(rules, points(rules, noise_free(plant, fault, true))))
    assert true == pytest.approx(isolation.degree[row(plant, fault)], rel=1e-3)
    assert {row(plant, fault)} == {*np.argmax(isolation.probability, axis=0)}
