"""The rules in the plan equal those of method.md, section 3, at readings that fit nothing."""

from __future__ import annotations

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array

from tests.method import by_hand
from tests.method.readings import PUMPS, evaluate, noise_free, ruleset

KINDS = {
    plant: {"A": plant.removeprefix("abc-") if "-" in plant else "pcp", "B": "pcp"}
    for plant in PUMPS
}
SCATTER = {"n": 0.001, "dp": 0.003, "P_el": 0.1}
"""So far that no two observers agree, and every square root exists."""


def arbitrary(plant: str, points: int = 50) -> dict[str, Array]:
    """Readings that fit together in no plant."""
    random = np.random.default_rng(16)
    result = {}
    for name, healthy in noise_free(plant).items():
        reach = SCATTER.get(name.split(".")[1], 0.0)
        result[name] = healthy[0] * random.uniform(1 - reach, 1 + reach, points)
    return result


@pytest.mark.parametrize("plant", PUMPS)
def test_rules_by_hand(plant: str) -> None:
    """All nine residuals, first minus second, in l/h. All cells of the table of section 3, clogging
    and widening at the same flow; Eq. 16 of dp_mod, static part included, for the mixer sum of
    m_eff less m_resis; forms without linearisation, no value where no reading could be right."""
    rules, values, kinds = ruleset(plant), arbitrary(plant), KINDS[plant]
    found = evaluate(rules, values)
    for name, R in by_hand.residuals(kinds, values).items():
        assert R == pytest.approx(found[f"R:{name}"] * 3.6e6, rel=1e-8, abs=1e-7), name
    changed = (".clogging", ".widening")
    expected = {
        "linear": by_hand.rules(kinds, values, paper=False),
        "paper": {
            cell: x
            for cell, x in by_hand.rules(kinds, values, paper=True).items()
            if cell.split(":")[0][1:] in changed
        },
        "exact": by_hand.exact(kinds, values),
    }
    for form, degrees in expected.items():
        assert {f"{c.fault}:{c.residual}" for c in rules.cells if form in c.forms} == set(degrees)
        for cell, x in degrees.items():
            assert np.isfinite(x).any()
            shown = pytest.approx(found[f"x:{form}:{cell}"], rel=1e-7, abs=1e-8, nan_ok=True)
            assert x == shown, (form, cell)


def test_written_rules_read_like_the_paper() -> None:
    """The rules shown beside a diagnosis are Eq. 12 and, with its own slope, Eq. 16."""
    equations = {(c.fault, c.residual): c.equation for c in ruleset("abc").cells}
    assert "x = R/A.pump, R = A.pump-plant" == equations["A.leakage", "A.pump-plant"]
    own = "D = R/mu, mu = - d(A.plant)/d(A.loss), R = A.pump-plant"
    assert f"x = D/(A.loss - D), {own}" == equations["A.clogging", "A.pump-plant"]
    assert f"x = -D/(A.loss - D), {own}" == equations["A.widening", "A.pump-plant"]
