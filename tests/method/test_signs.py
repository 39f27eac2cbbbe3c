"""Signs of the fault-symptom matrix: Figure 4 of the seed paper, other plants, and the simulator
(method.md, section 2, claims 3, 4 and 18)."""

from typing import Any

import pytest

from rulec.commands.matrix import json_form
from tests.method.readings import PUMPS, data, evaluate, noise_free, row_of, ruleset, signs

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
