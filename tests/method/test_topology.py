"""Other plants from other plant files, nothing else (method.md, section 2, claim 18)."""

from __future__ import annotations

from itertools import product

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
def test_derived_signs(plant: str, fault: str) -> None:
    """The matrix has the listed signs."""
    matrix = json_form(ruleset(plant))
    cells = dict(zip(matrix["residuals"], row_of(matrix, fault), strict=True))
    assert expected_row(plant, fault) == [cells[r] for r in residuals_of(plant)]


@pytest.mark.parametrize(("plant", "fault"), CASES)
def test_simulated_signs(plant: str, fault: str) -> None:
    """The simulator's readings at 20 % have them too."""
    rules = ruleset(plant)
    values = evaluate(rules, noise_free(plant, fault, 0.2))
    flow = rules.observer_by_id["A.pump"].reference
    assert expected_row(plant, fault) == signs(values, residuals_of(plant), flow)


def test_adjacency_matrix_is_as_good_as_a_list() -> None:
    """The same matrix, gains and detectable degrees."""
    as_list, as_matrix = json_form(ruleset("series")), json_form(ruleset("series-adjacency"))
    names = as_list.pop("plant"), as_matrix.pop("plant")
    assert ("series", "series-adjacency") == names
    order = {name: i for i, name in enumerate(as_matrix["residuals"])}
    rows = {name: i for i, name in enumerate(as_matrix["faults"])}
    assert set(as_list["residuals"]) == set(order)
    assert set(as_list["faults"]) == set(rows)
    for kind, fault, residual in product(("signs", "gains", "detectable"), rows, order):
        i, j = as_list["faults"].index(fault), as_list["residuals"].index(residual)
        found = as_matrix[kind][rows[fault]][order[residual]]
        expected = as_list[kind][i][j]
        assert expected == (found if found is None else pytest.approx(found, rel=1e-9))


def test_only_the_connections_differ() -> None:
    """The plants abc, three and series use the same module types with the same values."""
    tables = []
    for plant in ("abc", "three", "series"):
        values = {(p.id.split(".", 1)[1], p.value, p.unit) for p in ruleset(plant).parameters}
        tables.append(values)
    assert tables[0] == tables[1] == tables[2]


@pytest.mark.parametrize("plant", TABLE)
def test_no_two_faults_have_the_same_row(plant: str) -> None:
    """Every fault keeps a signature of its own, also where mixers follow each other."""
    matrix = json_form(ruleset(plant))
    assert len(matrix["faults"]) == len({tuple(row) for row in matrix["signs"]})
