"""Splits, parallel mixers, recirculation, modules without observer, against an own solver; residual
identities and rank of trees (method.md, claims 1 and 2)."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.isolate import isolate
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.redundancy import residual_basis

from rulec.commands.matrix import json_form
from rulec.passes.pipeline import compile_plant
from tests.method.loops import OUTSIDE, Branch, DosingBranch, Resistance, readings
from tests.method.readings import (
    PLANTS,
    evaluate,
    noise_free,
    points,
    row_of,
    ruleset,
    signs,
    to_si,
)

NARROW, DN15, HEADER = 9.0e-7, 3.5e-7, 2.0e-7
FEEDS: dict[str, Branch] = {
    "A": DosingBranch(OUTSIDE, "in"),
    "B": DosingBranch(OUTSIDE, "in", 800.0),
}
BRANCHES: dict[str, dict[str, Branch]] = {
    "parallel": {
        **FEEDS,
        "M1": Resistance("in", "out", DN15),
        "M2": Resistance("in", "out", NARROW),
        "C": Resistance("out", OUTSIDE, DN15),
    },
    "recirculation": {
        "A": DosingBranch(OUTSIDE, "in"),
        "R": DosingBranch("out", "in", 500.0),
        "M": Resistance("in", "out", DN15),
        "E": Resistance("out", OUTSIDE, DN15),
    },
    "pipe": {
        **FEEDS,
        "P": Resistance("in", "out", shown=False),
        "C": Resistance("out", OUTSIDE, DN15),
    },
    "header": {
        **FEEDS,
        "H": Resistance("in", "split", HEADER),
        "K1": Resistance("split", "vessel", DN15),
        "K2": Resistance("split", "vessel", NARROW),
        "T": Resistance("vessel", OUTSIDE, shown=False),
    },
}
BRANCHES["half-header"] = {
    **BRANCHES["header"],
    "K2": Resistance("split", "vessel", NARROW, shown=False),
}
UNOBSERVED = {
    "parallel": set(),
    "recirculation": set(),
    "pipe": {"P"},
    "header": {"T"},
    "half-header": {"K2", "T", "K1.clogging", "K1.widening"},
}


def values(plant: str, fault: str = "", degree: float = 0.0) -> dict[str, Array]:
    """Noise-free readings of the independent solver, SI."""
    found = readings(BRANCHES[plant], {fault: degree} if fault else {})
    return to_si(ruleset(plant), {name: np.array([value]) for name, value in found.items()})


@pytest.mark.parametrize("plant", BRANCHES)
def test_loops_and_splits(plant: str) -> None:
    """On a healthy plant all residuals vanish to 1e-6 of the flow, named or not. A fault of 20 %
    moves exactly the residuals that the matrix says, the way it says; what leaves no trace is told.
    """
    rules, healthy = ruleset(plant), values(plant)
    found, flow = evaluate(rules, healthy), rules.observer_by_id["A.pump"].reference
    basis = residual_basis(rules, np.ones(len(rules.observers), dtype=bool))
    flows = np.array([found[f"q:{o.id}"][0] for o in rules.observers])
    named = [found[f"R:{r.id}"][0] for r in rules.residuals]
    assert 0.0 == pytest.approx(np.abs([*named, *(basis @ flows)]).max(), abs=1e-6 * flow)
    assert [False] == isolate(rules, observe(rules, points(rules, healthy))).deviating.tolist()
    form, residuals = json_form(rules), [r.id for r in rules.residuals]
    for fault in (f.id for f in rules.faults):
        shown = evaluate(rules, values(plant, fault, 0.2))
        assert row_of(form, fault) == signs(shown, residuals, flow), fault
    assert UNOBSERVED[plant] == set(rules.unobserved)


def test_as_adjacency_matrix(tmp_path: Path) -> None:
    """The same graph as a matrix gives the same residuals and signs."""
    data: dict[str, Any] = yaml.safe_load((PLANTS / "half-header" / "plant.yaml").read_text())
    names = list(data["modules"])
    edges = {tuple(c.split(" -> ")) for c in data.pop("connections")}
    with (tmp_path / "a.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["", *names])
        writer.writerows([a, *(int((a, b) in edges) for b in names)] for a in names)
    (tmp_path / "plant.yaml").write_text(yaml.dump({**data, "adjacency": "a.csv"}, sort_keys=False))
    assert json_form(ruleset("half-header")) == json_form(compile_plant(tmp_path))


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
