"""Uncertainties of residuals and rules against Monte Carlo (method.md, claims 10 and 12)."""

from __future__ import annotations

import numpy as np
import pytest
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.paper_mode import judge_by_paper

from tests.method.readings import PUMPS, evaluate, noise_free, noisy, points, ruleset

SEEDS = 20_000
SMALL = 0.2
"""Share of the real noise with which curvature does not count yet."""


@pytest.mark.parametrize("plant", PUMPS)
@pytest.mark.parametrize("fault", ["", "A.leakage", "A.P_el.high"])
def test_scatter_as_propagated(plant: str, fault: str) -> None:
    """Claim 12: propagation from raw inputs, sensors alone, within 5 %: residuals of a healthy
    plant, and degrees by rules without linearisation."""
    rules, values = ruleset(plant), noise_free(plant, fault, 0.3)
    scattered = evaluate(rules, noisy(rules, values, SEEDS, np.random.default_rng(12), SMALL))
    expected = evaluate(rules, values, parameters=0.0)
    keys = {f"R:{r.id}": f"u:{r.id}" for r in rules.residuals}
    if fault:
        cells = [f"linear:{fault}:{c.residual}" for c in rules.cells_of_fault[fault]]
        keys = {f"x:{cell}": f"ux:{cell}" for cell in cells}
    for key, u in keys.items():
        assert expected[u][0] == pytest.approx(np.std(scattered[key]) / SMALL, rel=0.05), key


@pytest.mark.parametrize("fault", ["A.clogging", "A.widening", "A.dp.high", "C.dp.low"])
def test_linear_rules_are_not_overconfident(fault: str) -> None:
    """The error of a linearised degree is within its bounds, the model's part included."""
    rules, values = ruleset("abc"), noise_free("abc", fault, 0.2)
    found = evaluate(rules, noisy(rules, values, SEEDS, np.random.default_rng(12)))
    for cell in rules.cells_of_fault[fault]:
        key = f"linear:{fault}:{cell.residual}"
        inside = np.abs(found[f"x:{key}"] - 0.2) <= 2 * found[f"ux:{key}"]
        assert np.mean(inside) > 0.93, cell.residual


def test_lower_bound_is_never_narrower_than_upper_bound() -> None:
    """Claim 10: minima of degree and bounds, with every rule triggered."""
    rules = ruleset("abc")
    for fault in ("A.leakage", "C.clogging", "A.dp.low", "B.P_el.high"):
        values = noisy(rules, noise_free("abc", fault, 0.3), 500, np.random.default_rng(10))
        result = judge_by_paper(rules, observe(rules, points(rules, values)))
        whole = result.lower > 0
        below, above = result.degree - result.lower, result.upper - result.degree
        assert np.all(below[whole] >= above[whole] - 1e-12)
        assert whole.any()
