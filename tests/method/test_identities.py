"""Residual identities, rank, and silence of a healthy plant (method.md, claims 1 and 2)."""

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.isolate import isolate
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.paper_mode import judge_by_paper
from rulec_runtime.diagnosis.steady.redundancy import residual_basis

from tests.method.readings import PUMPS, evaluate, noise_free, points, ruleset

TREES = {"abc": (2, 1), "three": (3, 1), "series": (3, 2), "mixing-rig": (5, 2)}
"""Dosing modules and mixers."""


def scattered(plant: str) -> dict[str, Array]:
    """Readings far from any operating point; all square roots exist."""
    random = np.random.default_rng(1)
    reach = {"n": (1.0, 1.2), "dp": (0.9, 1.0), "P_el": (0.2, 2.0), "mixer": (0.3, 0.8)}
    result = {}
    for name, healthy in noise_free(plant).items():
        module, signal = name.split(".")
        is_mixer = f"{module}.resis" in ruleset(plant).observer_by_id
        low, high = reach.get("mixer" if is_mixer else signal, (1.0, 1.0))
        result[name] = healthy[0] * random.uniform(low, high, 200)
    return result


@pytest.mark.parametrize("plant", TREES)
def test_residual_identities(plant: str) -> None:
    """Three identities tie the residuals together for any readings, to 1e-9 of the flow: of 9
    residuals 5 are independent, of 21 residuals 12, two per dosing module and one per mixer. Seven
    faults per dosing module and four per mixer."""
    rules, found = ruleset(plant), evaluate(ruleset(plant), scattered(plant))
    R = {r.id: found[f"R:{r.id}"] for r in rules.residuals}
    flow = 1e-9 * rules.observer_by_id["A.pump"].reference
    dosing = [m for m in rules.modules if f"{m}.power-pump" in R]
    mixers = [m for m in rules.modules if m not in dosing]
    assert all(np.isfinite(r).all() for r in R.values())
    for m in dosing:
        expected = R[f"{m}.power-plant"] - R[f"{m}.pump-plant"]
        assert expected == pytest.approx(R[f"{m}.power-pump"], abs=flow)
    for m in mixers:
        (spec,) = (r for r in rules.residuals if r.id == f"{m}.pump-resis")
        upstream = [t.observer.split(".")[0] for t in spec.terms if t.sign > 0]
        for kind in ("pump", "power"):
            expected = sum(R[f"{n}.{kind}-plant"] for n in upstream) + R[f"{m}.plant-resis"]
            assert expected == pytest.approx(R[f"{m}.{kind}-resis"], abs=flow)
    assert TREES[plant] == (len(dosing), len(mixers))
    basis = residual_basis(rules, np.ones(len(rules.observers), dtype=bool))
    assert 2 * len(dosing) + len(mixers) == len(basis)
    assert 3 * (len(dosing) + len(mixers)) == len(R)
    assert 7 * len(dosing) + 4 * len(mixers) == len(rules.faults)


@pytest.mark.parametrize("plant", [*PUMPS, "series", "mixing-rig"])
def test_healthy_plant_is_silent(plant: str) -> None:
    """Without fault and noise all residuals vanish, and no hypothesis has a degree."""
    rules = ruleset(plant)
    observed = observe(rules, points(rules, noise_free(plant)))
    size = 1e-6 * rules.observer_by_id["A.pump"].reference
    assert 0.0 == pytest.approx(np.abs(observed.residuals).max(), abs=size)
    assert 0.0 == pytest.approx(judge_by_paper(rules, observed).degree.max(), abs=1e-9)
    assert [False] == isolate(rules, observed).deviating.tolist()
