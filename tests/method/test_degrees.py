"""Signs of the fault-symptom matrix: Figure 4 of the seed paper, other plants, and the simulator
(method.md, section 2, claims 3, 4 and 18); degrees from its noise-free readings, which grow with
the fault (section 3, claims 5 to 8, and claim 20)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.isolate import isolate
from rulec_runtime.diagnosis.steady.observe import observe
from rulec_runtime.diagnosis.steady.paper_mode import judge_by_paper

from rulec.commands.matrix import json_form
from tests.method.readings import (
    PUMPS,
    data,
    evaluate,
    noise_free,
    points,
    row_of,
    ruleset,
    signs,
)

FIGURE, OTHERS = data("figure4.yaml"), data("signs.yaml")
RESIDUALS: list[str] = FIGURE["residuals"]
PRINTED = {fault: list(row.replace(" ", "")) for fault, row in FIGURE["printed"].items()}
EXPLAINED: dict[tuple[str, str], str] = {
    (fault, residual): sign
    for difference in FIGURE["differences"]
    for fault, cells in difference["cells"].items()
    for residual, sign in cells.items()
}
DOSING, MIXER = (
    ("pump-plant", "power-plant", "power-pump"),
    ("pump-resis", "power-resis", "plant-resis"),
)


def simulated(plant: str, fault: str, residuals: list[str]) -> list[str]:
    """Signs of the residuals of noise-free readings of the simulator at a degree of 20 %."""
    rules = ruleset(plant)
    found = evaluate(rules, noise_free(plant, fault, 0.2))
    return signs(found, residuals, rules.observer_by_id["A.pump"].reference)


def test_the_matrix_differs_from_the_figure_only_where_explained() -> None:
    """18 faults and 9 residuals, no more. Twelve rows are as printed, sixteen without power-pump:
    the two left over are of the mixer's sensor."""
    matrix = json_form(ruleset("abc"))
    assert (RESIDUALS, set(PRINTED)) == (matrix["residuals"], set(matrix["faults"]))
    found = {
        (fault, residual): sign
        for fault, printed in PRINTED.items()
        for residual, sign, own in zip(RESIDUALS, row_of(matrix, fault), printed, strict=True)
        if sign != own
    }
    assert EXPLAINED == found
    assert 12 == len(PRINTED) - len({fault for fault, _ in found})
    left = {fault for fault, residual in found if not residual.endswith("power-pump")}
    assert {"C.dp.low", "C.dp.high"} == left


@pytest.mark.parametrize(("plant", "low"), [*zip(PUMPS, "++-", strict=True)])
def test_simulated_signs_are_those_of_the_derived_matrix(plant: str, low: str) -> None:
    """For every kind of pump. A displacement pump draws more power at more pressure, a centrifugal
    pump less; above its shut-off pressure that has no flow: no sign to compare."""
    derived = json_form(ruleset(plant))
    for fault in PRINTED:
        if (plant, fault) != ("abc-centrifugal", "A.dp.high"):
            assert row_of(derived, fault) == simulated(plant, fault, RESIDUALS), fault
    assert low == row_of(derived, "A.dp.low")[RESIDUALS.index("A.power-pump")]


@pytest.mark.parametrize("plant", OTHERS)
def test_signs_of_other_plants(plant: str) -> None:
    """Other plants from other plant files, nothing else: the matrix has the listed signs, and the
    simulator's readings have them too; every fault keeps a row of its own."""
    table: dict[str, Any] = OTHERS[plant]
    matrix = json_form(ruleset(plant))
    own = [[f"{block}.{name}" for name in DOSING] for block in table["blocks"]]
    summed = [[f"{block}.{name}" for name in MIXER] for block in table["blocks"]]
    there = set(matrix["residuals"])
    names = [r for a, b in zip(own, summed, strict=True) for r in (a if there >= {*a} else b)]
    assert set(names) == there
    for fault, row in table["rows"].items():
        cells = dict(zip(matrix["residuals"], row_of(matrix, fault), strict=True))
        expected = list(row.replace(" ", ""))
        assert expected == [cells[r] for r in names] == simulated(plant, fault, names), fault
    assert len(matrix["faults"]) == len({tuple(row) for row in matrix["signs"]})


TABLE = data("section3.yaml")
VALUES = [
    pytest.param(table["plant"], v, id=f"{kind}-{v['fault']}-{v['residual']}-{v['form']}")
    for kind, table in TABLE.items()
    for v in table["values"]
]
STATIC = {"abc": 0.05e5, "large-centrifugal": 0.02e5}


def rules_of(plant: str, fault: str, form: str, degree: Any) -> dict[str, Array]:
    """Degrees that the rules of a fault give when it is really there."""
    rules = ruleset(plant)
    found = evaluate(rules, noise_free(plant, fault, degree))
    return {
        c.residual: found[f"x:{form}:{fault}:{c.residual}"]
        for c in rules.cells_of_fault[fault]
        if form in c.forms
    }


def of_whole_pressure(degree: float, values: Mapping[str, Array], static: float) -> float:
    """A degree of the friction loss as one of the whole loss: the same excess, another base."""
    whole = float(values["A.dp"][0] - values["C.dp"][0])
    excess = (whole - static) * degree / (1 + degree)
    return excess / (whole - excess)


@pytest.mark.parametrize(("plant", "value"), VALUES)
def test_figures_of_section_3(plant: str, value: dict[str, Any]) -> None:
    """Every figure printed for a true degree of 0.2, or its difference explained."""
    found = float(rules_of(plant, value["fault"], value["form"], 0.2)[value["residual"]][0])
    assert value["found"] == pytest.approx(found, abs=6e-5)
    if value.get("because") == "open":
        return
    if value.get("because") == "k0":
        sign = -1 if value["fault"].endswith("widening") else 1
        values = noise_free(plant, value["fault"], 0.2)
        found = sign * of_whole_pressure(sign * found, values, STATIC[plant])
    assert value["printed"] == pytest.approx(found, abs=1.0e-3)


@pytest.mark.parametrize("plant", PUMPS)
def test_rules_that_are_exact(plant: str) -> None:
    """For every kind of pump, own rules and those downstream. Claim 5: leakage by pump and power.
    Claim 8: |l - 1| of a power reading. Section 3: solved for the reading, one wrong observer gives
    the degree of a pressure reading itself."""
    true = np.array([0.05, 0.2, 0.4, 0.8])
    found = rules_of(plant, "A.leakage", "linear", true)
    assert {"A.pump-plant", "A.power-plant", "C.pump-resis", "C.power-resis"} == set(found)
    assert all(true == pytest.approx(x, abs=1e-6) for x in found.values())
    for way, off in (("low", [0.05, 0.2, 0.7]), ("high", [0.1, 0.5, 1.0])):
        for form in ("linear", "exact"):
            found = rules_of(plant, f"A.P_el.{way}", form, off)
            assert {"A.power-plant", "A.power-pump", "C.power-resis"} == set(found)
            assert all(off == pytest.approx(x, abs=1e-9) for x in found.values())
    for fault in ("A.dp.low", "C.dp.low", "C.dp.high", "A.widening"):
        for x in rules_of(plant, fault, "exact", 0.2).values():
            assert 0.2 == pytest.approx(x[0], abs=1e-6)
    two_mixers = rules_of("mixing-rig", "A.leakage", "linear", 0.3)
    assert [0.3] * 6 == pytest.approx([x[0] for x in two_mixers.values()], abs=1e-6)


@pytest.mark.parametrize("fault", ["A.clogging", "C.clogging"])
def test_beyond_the_pole_of_the_linear_rule(fault: str) -> None:
    """Claim 7: beyond x = 3 nothing positive comes out, since g_ref would be negative. Paper mode
    gives no hypothesis a degree outside its range; the default mode still judges rightly."""
    rules, true = ruleset("abc"), [3.05, 3.5, 5.0]
    for x in rules_of("abc", fault, "linear", [*true, 10.0]).values():
        assert np.all(x < 0)
    observed = observe(rules, points(rules, noise_free("abc", fault, true)))
    names = [f.id for f in rules.faults]
    result = judge_by_paper(rules, observed)
    assert np.all(result.degree >= 0)
    assert np.all(result.degree <= np.array([f.highest for f in rules.faults])[:, None])
    assert not result.degree[names.index(fault.replace("clogging", "widening"))].any()
    isolation = isolate(rules, observed)
    assert [fault] * 3 == [names[i] for i in np.argmax(isolation.probability, axis=0)]
    assert true == pytest.approx(isolation.degree[names.index(fault)], rel=0.01)


LARGEST = {"leakage": 0.95, "clogging": 2.5, "widening": 0.75, "high": 1.2, "low": 0.7}
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
    top = SHORTER.get((plant, fault), LARGEST[fault.rsplit(".", 1)[1]])
    true = np.linspace(0.0, top, 25)[1:]
    observed = observe(rules, points(rules, noise_free(plant, fault, true)))
    assert observed.valid.all()
    assert np.all(np.diff(judge_by_paper(rules, observed).degree[own]) >= -1e-9)
    isolation = isolate(rules, observed)
    deviating = isolation.deviating
    assert np.all(np.diff(deviating.astype(int)) >= 0)
    assert true[deviating] == pytest.approx(isolation.degree[own, deviating], rel=1e-3)
    assert np.all(isolation.probability[own, deviating] > 0)


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
