"""The fault-symptom matrix against Figure 4 of the seed paper (method.md, claims 3 and 4)."""

from __future__ import annotations

from typing import Any

import pytest

from rulec.commands.matrix import json_form
from tests.method.readings import PUMPS, data, evaluate, noise_free, row_of, ruleset, signs

FIGURE = data("figure4.yaml")
RESIDUALS: list[str] = FIGURE["residuals"]
PRINTED = {fault: list(row.replace(" ", "")) for fault, row in FIGURE["printed"].items()}
EXPLAINED: dict[tuple[str, str], str] = {
    (fault, residual): sign
    for difference in FIGURE["differences"]
    for fault, cells in difference["cells"].items()
    for residual, sign in cells.items()
}
HIDDEN = "A.dp.high"
"""Above its shut-off pressure a centrifugal pump has no flow: no sign to compare."""


def differences(rows: dict[str, list[str]]) -> dict[tuple[str, str], str]:
    """Cells that differ from the printed figure."""
    return {
        (fault, residual): row[i]
        for fault, row in rows.items()
        for i, residual in enumerate(RESIDUALS)
        if row[i] != PRINTED[fault][i]
    }


def masked(rows: dict[str, list[str]]) -> dict[str, list[str]]:
    """Power-pump set to zero in the rows of pump pressure sensors."""
    return {
        fault: ["0" if ".dp." in fault and r.endswith("power-pump") else s for r, s in cells]
        for fault, cells in ((f, zip(RESIDUALS, row, strict=True)) for f, row in rows.items())
    }


def measured(plant: str, degree: float = 0.2) -> dict[str, list[str]]:
    """Signs of the residuals of noise-free readings of the simulator."""
    rules = ruleset(plant)
    rows = {}
    for fault in PRINTED:
        values = evaluate(rules, noise_free(plant, fault, degree))
        rows[fault] = signs(values, RESIDUALS, rules.observer_by_id["A.pump"].reference)
    return rows


@pytest.fixture(scope="module")
def matrix() -> dict[str, Any]:
    """The derived matrix of the plant abc."""
    return json_form(ruleset("abc"))


def test_all_rows_and_columns_of_the_figure_are_there(matrix: dict[str, Any]) -> None:
    """The derivation finds the 18 faults and 9 residuals of the figure, no more."""
    assert (RESIDUALS, set(PRINTED)) == (matrix["residuals"], set(matrix["faults"]))


def test_derived_matrix_differs_only_where_explained(matrix: dict[str, Any]) -> None:
    """Every difference from the printed figure is listed with its reason."""
    assert EXPLAINED == differences({fault: row_of(matrix, fault) for fault in PRINTED})


def test_twelve_rows_are_as_printed_and_sixteen_without_power_pump() -> None:
    """Signs of simulated residuals at a degree of 20 %: the two rows left over are of dp of C."""
    rows = measured("abc")
    equal = [f for f, row in rows.items() if row == PRINTED[f]]
    mask = [f for f, row in masked(rows).items() if row == PRINTED[f]]
    assert (12, 16) == (len(equal), len(mask))
    assert {"C.dp.low", "C.dp.high"} == set(PRINTED) - set(mask)
    for fault in ("C.dp.low", "C.dp.high"):
        assert rows[fault][:3] == rows[fault][3:6]


@pytest.mark.parametrize("plant", PUMPS)
def test_simulated_signs_are_those_of_the_derived_matrix(plant: str) -> None:
    """What the matrix predicts at a small degree holds at 20 %, for every kind of pump."""
    derived = json_form(ruleset(plant))
    rows = measured(plant)
    if plant == "abc-centrifugal":
        del rows[HIDDEN]
    assert {fault: row_of(derived, fault) for fault in rows} == rows


@pytest.mark.parametrize(
    ("plant", "low"), [("abc", "+"), ("abc-membrane", "+"), ("abc-centrifugal", "-")]
)
def test_power_pump_changes_sign_with_the_kind_of_pump(plant: str, low: str) -> None:
    """A displacement pump draws more power at more pressure, a centrifugal pump less."""
    derived = json_form(ruleset(plant))
    high = {"+": "-", "-": "+"}[low]
    column = RESIDUALS.index("A.power-pump")
    found = [row_of(derived, f"A.dp.{kind}")[column] for kind in ("low", "high")]
    assert [low, high] == found
