"""Other plants from other plant files, nothing else (method.md, section 2, claim 18)."""

from __future__ import annotations

import pytest

from rulec.commands.matrix import json_form
from tests.method.readings import data, evaluate, noise_free, row_of, ruleset, signs

TABLE = data("signs.yaml")
CASES = [(plant, fault) for plant, table in TABLE.items() for fault in table["rows"]]


def residuals_of(plant: str) -> list[str]:
    """Residuals in the order of the columns of the table."""
    found = {r.id for r in ruleset(plant).residuals}
    dosing, mixer = ("pump-plant", "power-plant", "power-pump"), ("resis", "resis", "resis")
    names = []
    for module in TABLE[plant]["blocks"]:
        own = [f"{module}.{name}" for name in dosing]
        summed = [
            f"{module}.{k}-{r}" for k, r in zip(("pump", "power", "plant"), mixer, strict=True)
        ]
        names += own if set(own) <= found else summed
    assert set(names) == found
    return names


def expected_row(plant: str, fault: str) -> list[str]:
    """A row of the table."""
    return list(TABLE[plant]["rows"][fault].replace(" ", ""))


@pytest.mark.parametrize(("plant", "fault"), CASES)
def test_signs(plant: str, fault: str) -> None:
    """The matrix has the listed signs, and the simulator's readings at 20 % have them too."""
    rules = ruleset(plant)
    matrix, names = json_form(rules), residuals_of(plant)
    cells = dict(zip(matrix["residuals"], row_of(matrix, fault), strict=True))
    assert expected_row(plant, fault) == [cells[r] for r in names]
    values = evaluate(rules, noise_free(plant, fault, 0.2))
    flow = rules.observer_by_id["A.pump"].reference
    assert expected_row(plant, fault) == signs(values, names, flow)


@pytest.mark.parametrize("plant", TABLE)
def test_no_two_faults_have_the_same_row(plant: str) -> None:
    """Every fault keeps a signature of its own, also where mixers follow each other."""
    matrix = json_form(ruleset(plant))
    assert len(matrix["faults"]) == len({tuple(row) for row in matrix["signs"]})
