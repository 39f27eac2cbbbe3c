"""Splits, parallel mixers, recirculation, modules without observer, against an own solver."""

from __future__ import annotations

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
from tests.method.readings import PLANTS, evaluate, points, row_of, ruleset, signs, to_si

NARROW, DN15, HEADER = 9.0e-7, 3.5e-7, 2.0e-7
BRANCHES: dict[str, dict[str, Branch]] = {
    "parallel": {
        "A": DosingBranch(OUTSIDE, "in"),
        "B": DosingBranch(OUTSIDE, "in", 800.0),
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
        "A": DosingBranch(OUTSIDE, "in"),
        "B": DosingBranch(OUTSIDE, "in", 800.0),
        "P": Resistance("in", "out", shown=False),
        "C": Resistance("out", OUTSIDE, DN15),
    },
    "header": {
        "A": DosingBranch(OUTSIDE, "in"),
        "B": DosingBranch(OUTSIDE, "in", 800.0),
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
DOWNSTREAM = {
    "parallel": {"A": "M1 C", "B": "M1 C"},
    "recirculation": {"A": "M E", "R": "M"},
    "pipe": {"A": "C", "B": "C"},
    "header": {"A": "H K1", "B": "H K1"},
    "half-header": {"A": "H K1", "B": "H K1"},
}


def values(plant: str, fault: str = "", degree: float = 0.0) -> dict[str, Array]:
    """Noise-free readings of the independent solver, SI."""
    found = readings(BRANCHES[plant], {fault: degree} if fault else {})
    return to_si(ruleset(plant), {name: np.array([value]) for name, value in found.items()})


@pytest.mark.parametrize("plant", BRANCHES)
def test_healthy_plant_is_silent(plant: str) -> None:
    """All residuals vanish to 1e-6 of the flow, named or not, and nothing is found."""
    rules = ruleset(plant)
    healthy = values(plant)
    found = evaluate(rules, healthy)
    size = 1e-6 * rules.observer_by_id["A.pump"].reference
    assert 0.0 == pytest.approx(max(abs(found[f"R:{r.id}"][0]) for r in rules.residuals), abs=size)
    basis = residual_basis(rules, np.ones(len(rules.observers), dtype=bool))
    flows = np.array([found[f"q:{o.id}"][0] for o in rules.observers])
    assert 0.0 == pytest.approx(np.abs(basis @ flows).max(), abs=size)
    assert [False] == isolate(rules, observe(rules, points(rules, healthy))).deviating.tolist()


@pytest.mark.parametrize("plant", BRANCHES)
def test_named_residuals_have_the_rank_of_the_runtimes(plant: str) -> None:
    """As many independent comparisons stand under a name as the balances allow."""
    rules = ruleset(plant)
    column = {o.id: i for i, o in enumerate(rules.observers)}
    named = np.zeros((len(rules.residuals), len(column)))
    for row, residual in zip(named, rules.residuals, strict=True):
        row[[column[t.observer] for t in residual.terms]] = [t.sign for t in residual.terms]
    basis = residual_basis(rules, np.ones(len(column), dtype=bool))
    assert len(basis) == np.linalg.matrix_rank(named, tol=1e-9)


@pytest.mark.parametrize("plant", BRANCHES)
def test_derived_signs_are_the_true_ones(plant: str) -> None:
    """A fault of 20 % moves exactly the residuals that the matrix says, the way it says."""
    rules = ruleset(plant)
    form, residuals = json_form(rules), [r.id for r in rules.residuals]
    flow = rules.observer_by_id["A.pump"].reference
    for fault in (f.id for f in rules.faults):
        found = evaluate(rules, values(plant, fault, 0.2))
        assert row_of(form, fault) == signs(found, residuals, flow), fault


@pytest.mark.parametrize("plant", BRANCHES)
def test_unobserved_is_told(plant: str) -> None:
    """Modules and faults that leave no trace; the signs above hold for them, too."""
    assert UNOBSERVED[plant] == set(ruleset(plant).unobserved)


@pytest.mark.parametrize("plant", BRANCHES)
def test_what_lies_downstream(plant: str) -> None:
    """A measured branch between two places serves; a loop closes at the module's own inlet."""
    for module, expected in DOWNSTREAM[plant].items():
        spec = ruleset(plant).observer_by_id[f"{module}.plant"]
        assert {f"{module}.dp", *(f"{m}.dp" for m in expected.split())} == set(spec.signals)


@pytest.mark.parametrize("plant", BRANCHES)
def test_as_adjacency_matrix(plant: str, tmp_path: Path) -> None:
    """The same graph as a matrix gives the same residuals and signs."""
    data: dict[str, Any] = yaml.safe_load((PLANTS / plant / "plant.yaml").read_text())
    names = list(data["modules"])
    edges = {tuple(c.split(" -> ")) for c in data.pop("connections")}
    with (tmp_path / "a.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["", *names])
        writer.writerows([a, *(int((a, b) in edges) for b in names)] for a in names)
    (tmp_path / "plant.yaml").write_text(yaml.dump({**data, "adjacency": "a.csv"}, sort_keys=False))
    expected, found = json_form(ruleset(plant)), json_form(compile_plant(tmp_path))
    assert expected == found
