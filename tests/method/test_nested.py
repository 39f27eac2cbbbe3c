"""Nested signatures, and what a minimum over non-zero residuals makes of them (claim 14)."""

import pytest
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.paper_mode import judge_by_paper

from tests.method.readings import chances, data, noise_free, points, ruleset


def test_tool_finds_all_nested_pairs() -> None:
    """Twelve of method.md, and four as power-pump is not zero where a pump pressure is wrong."""
    tables = data("nested.yaml").values()
    pairs = {(inner, outer) for t in tables for inner, outers in t.items() for outer in outers}
    assert 16 == len(pairs)
    assert pairs == {g.faults for g in ruleset("abc").ambiguous if g.kind == "nested"}
    assert "coincide" not in {g.kind for g in ruleset("abc").ambiguous}


@pytest.mark.parametrize(
    ("fault", "named", "degree", "own"),
    [("A.dp.low", "A.widening", 0.233, 0.188), ("C.dp.high", "C.clogging", 0.208, 0.197)],
)
def test_literal_rule_mislabels(fault: str, named: str, degree: float, own: float) -> None:
    """A noise-free sensor error of 20 % is taken for a change of the line (method.md, 2)."""
    rules = ruleset("abc")
    observed = observe(rules, points(rules, noise_free("abc", fault, 0.2)))
    result = judge_by_paper(rules, observed)
    names = [f.id for f in rules.faults]
    assert named == names[result.winner()[0]]
    found = [result.degree[names.index(name), 0] for name in (named, fault)]
    assert [degree, own] == pytest.approx(found, abs=5e-4)


def test_default_mode_claims_no_isolation_there() -> None:
    """At 10 % both causes stay possible, and a third is not; at 20 % the whole residual vector
    tells a clogging of the mixer from its sensor, which the minimum does not."""
    for fault, rival in (("A.dp.low", "A.widening"), ("A.clogging", "A.dp.high")):
        possible = {
            f: p for f, p in chances("abc", noise_free("abc", fault, 0.1)).items() if p > 0.02
        }
        assert {fault, rival} == set(possible)
        assert min(possible.values()) > 0.2
    for fault in ("C.dp.high", "C.clogging"):
        assert chances("abc", noise_free("abc", fault, 0.2))[fault] > 0.99
