"""Nested signatures, and what a minimum over non-zero residuals makes of them (claim 14)."""

from __future__ import annotations

import pytest
from rulec_runtime.diagnosis.steady.isolate import isolate
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.paper_mode import judge_by_paper

from rulec.commands.matrix import json_form
from tests.method.readings import data, noise_free, points, row_of, ruleset

NESTED = data("nested.yaml")


def pairs(table: dict[str, list[str]]) -> set[tuple[str, str]]:
    """(inner, outer) of a table."""
    return {(inner, outer) for inner, outers in table.items() for outer in outers}


def test_tool_finds_all_nested_pairs() -> None:
    """Sixteen pairs: power-pump is not zero where a pump pressure reads wrong."""
    found = {g.faults for g in ruleset("abc").ambiguous if g.kind == "nested"}
    assert 16 == len(found)
    assert pairs(NESTED["masked"]) | pairs(NESTED["added_by_power_pump"]) == found
    assert "coincide" not in {g.kind for g in ruleset("abc").ambiguous}


def test_twelve_pairs_are_left_without_power_pump() -> None:
    """With the entries masked that hide in the noise, exactly the pairs of method.md."""
    matrix = json_form(ruleset("abc"))
    signatures = {}
    for fault in matrix["faults"]:
        cells = dict(zip(matrix["residuals"], row_of(matrix, fault), strict=True))
        if fault[1:] in (".dp.low", ".dp.high") and fault[0] in "AB":
            cells[f"{fault[0]}.power-pump"] = "0"
        signatures[fault] = {c for c in cells.items() if c[1] != "0"}
    found = {(f, g) for f in signatures for g in signatures if signatures[f] < signatures[g]}
    assert 12 == len(found)
    assert pairs(NESTED["masked"]) == found


@pytest.mark.parametrize(
    ("fault", "named", "degree", "own"),
    [("A.dp.low", "A.widening", 0.233, 0.188), ("C.dp.high", "C.clogging", 0.208, 0.197)],
)
def test_literal_rule_mislabels(fault: str, named: str, degree: float, own: float) -> None:
    """A noise-free sensor error of 20 % is taken for a change of the line.

    method.md, section 2: 0.23 against 0.19, and 0.21 against 0.20.
    """
    rules = ruleset("abc")
    observed = observe(rules, points(rules, noise_free("abc", fault, 0.2)))
    result = judge_by_paper(rules, observed)
    names = [f.id for f in rules.faults]
    assert named == names[result.winner()[0]]
    found = [result.degree[names.index(name), 0] for name in (named, fault)]
    assert [degree, own] == pytest.approx(found, abs=5e-4)


def probabilities(fault: str, degree: float) -> dict[str, float]:
    """What the default mode says of a noise-free fault."""
    rules = ruleset("abc")
    observed = observe(rules, points(rules, noise_free("abc", fault, degree)))
    chances = isolate(rules, observed).probability[:, 0]
    return {f.id: float(p) for f, p in zip(rules.faults, chances, strict=True)}


def test_default_mode_claims_no_isolation_there() -> None:
    """At 10 % both causes stay possible, and a third is not; at 20 % the whole residual vector
    tells a clogging of the mixer from its sensor, which the minimum does not."""
    for fault, rival in (("A.dp.low", "A.widening"), ("A.clogging", "A.dp.high")):
        possible = {f: p for f, p in probabilities(fault, 0.1).items() if p > 0.02}
        assert {fault, rival} == set(possible)
        assert min(possible.values()) > 0.2
    for fault in ("C.dp.high", "C.clogging"):
        assert probabilities(fault, 0.2)[fault] > 0.99
