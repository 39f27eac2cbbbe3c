"""First contacts: what is drawn, and how answers are counted."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rulec.passes.pipeline import compile_plant
from rulec.prove.contacts import Judged, figures, judge, why
from rulec.prove.truth.contacts import CLASSES, KINDS, MODULE, ContactAnswer, Planned, planned
from rulec.simulation.equations import equations_of
from rulec.simulation.simulate import simulate_with
from tests.conftest import ROOT, plain_yaml
from tests.test_truth_same_bytes import digest_of

SOUND, OTHER = (Planned(1, "valve-characteristic", other).make().answer for other in (False, True))


def test_half_of_the_cases_have_another_law() -> None:
    drawn = [(case.kind, case.other) for case in planned(1)]
    assert len(drawn) == 40
    assert {4} == {drawn.count((kind, other)) for kind in KINDS for other in (True, False)}


def test_the_same_bytes_each_time(tmp_path: Path) -> None:
    first, second = planned(7, 2)
    digests = [digest_of(c.make(), tmp_path / str(i)) for i, c in enumerate((first, first, second))]
    assert digests[0] == digests[1] != digests[2]


def test_truth_lies_within_the_sheet() -> None:
    """Two standard uncertainties, as a maker's final inspection has it."""
    for case in (plan.make() for plan in planned(1)):
        for name, (value, u) in case.sheet.items():
            assert abs(case.answer.values[f"{MODULE}.{name}"] - value) <= 2.0 * u


def test_sensors_err_as_their_classes_say() -> None:
    for name, (bound, of) in CLASSES.items():
        stated = plain_yaml(ROOT / "kb" / "sensors" / f"{name}.yaml")["systematic"]
        share = 0.01 if stated["unit"] == "%" else 1.0
        assert (bound, of) == (pytest.approx(stated["bound"] * share), stated["of"])


@pytest.mark.parametrize("kind", KINDS)
def test_module_types_say_the_ordinary_laws(kind: str, tmp_path: Path) -> None:
    """The tool reads from the folder what the truth holds where nothing is off."""
    case = Planned(3, kind, False).make()
    case.write(tmp_path)
    rules, made = compile_plant(tmp_path / "plant"), case.kind
    shown = {s.id: (s.factor, s.offset) for s in rules.signals}
    given = {f"{MODULE}.{name}": case.true[name][:5] for name in made.ranges}
    si = {id_: values * shown[id_][0] + shown[id_][1] for id_, values in given.items()}
    found = simulate_with(equations_of(rules), si, {}).values
    typical = {n: p["value"] for n, p in made.stated["parameters"].items()}
    values = typical | {name: value for name, (value, _) in case.sheet.items()}
    at = {name: case.true[name][:5] for name in case.true}
    laws = made.law(values, at, dict.fromkeys(made.arguments, np.ones(5)), {})
    for name, expected in laws.items():
        factor, offset = shown[f"{MODULE}.{name}"]
        assert (found[f"{MODULE}.{name}"] - offset) / factor == pytest.approx(expected)


def form(verdict: str, *effects: dict[str, Any], **more: Any) -> dict[str, Any]:
    """An answer as `--json` tells it."""
    return {"verdict": verdict, "effects": effects, **more}


def effect(name: str, sure: float, *same: str) -> dict[str, Any]:
    """A finding with those that coincide with it."""
    alternatives = [
        {"effect": s, "id": f"{MODULE}.{s}", "probability": 0.3, "same": True} for s in same
    ]
    return {
        **{"effect": name, "id": f"{MODULE}.{name}", "module": MODULE, "modules": [MODULE]},
        **{"place": "x", "probability": sure / 2, "class_probability": sure, "parameters": {}},
        "alternatives": alternatives,
    }


@pytest.mark.parametrize(
    ("answer", "said", "found", "wrong"),
    [
        (SOUND, form("none"), True, False),
        (SOUND, form("unsure"), False, False),
        (SOUND, form("named", effect("quick-opening", 0.95)), False, True),
        (OTHER, form("named", effect("equal-percentage", 0.95)), True, False),
        (OTHER, form("ambiguous", effect("equal-percentage", 0.85)), False, False),
        (OTHER, form("named", effect("quick-opening", 0.95, "equal-percentage")), True, False),
        (OTHER, form("named", effect("quick-opening", 0.95)), False, True),
        (OTHER, {"error": "it failed"}, False, False),
    ],
)
def test_names_count_with_their_class(
    answer: ContactAnswer, said: dict[str, Any], found: bool, wrong: bool
) -> None:
    judged = judge(answer, said)
    assert (found, wrong) == (judged.found, bool(judged.wrong))


def test_figures_count_what_they_say() -> None:
    right, silent = judge(SOUND, form("none")), judge(SOUND, form("unsure"))
    named = judge(OTHER, form("named", effect("equal-percentage", 0.95)))
    false = judge(OTHER, form("named", effect("quick-opening", 0.95)))
    found = [right, silent, named, false]
    assert [(1, 2), (1, 2), (1, 4)] == [(r.hits, r.count) for r in figures(found)]
    assert [True, False, True, False] == [not why(j) for j in found]


def test_a_law_without_an_entry_is_found_where_it_is_called_unnamed() -> None:
    answer = replace(Planned(1, "pump-curve-exponent", True).make().answer, names=())
    said = [form("unnamed", locations=[{"module": MODULE, "place": p}]) for p in ("head", "P_law")]
    found: list[Judged] = [judge(answer, one) for one in said]
    assert [True, False] == [j.found for j in found]
