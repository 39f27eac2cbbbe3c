"""First contacts: what is drawn."""

from pathlib import Path

import numpy as np
import pytest

from rulec.passes.pipeline import compile_plant
from rulec.prove.truth.contacts import CLASSES, KINDS, MODULE, Planned, planned
from rulec.simulation.equations import equations_of
from rulec.simulation.simulate import simulate_with
from tests.conftest import ROOT, plain_yaml
from tests.test_truth_same_bytes import digest_of


def test_the_same_bytes_each_time(tmp_path: Path) -> None:
    first, second = planned(7, 2)
    digests = [digest_of(c.make(), tmp_path / str(i)) for i, c in enumerate((first, first, second))]
    assert digests[0] == digests[1] != digests[2]


def test_half_of_the_cases_have_another_law_and_truth_lies_within_the_sheet() -> None:
    """Two standard uncertainties, as a maker's final inspection has it."""
    plans = planned(1)
    drawn = [(plan.kind, plan.other) for plan in plans]
    assert len(drawn) == 40
    assert {4} == {drawn.count((kind, other)) for kind in KINDS for other in (True, False)}
    for case in (plan.make() for plan in plans):
        for name, (value, u) in case.sheet.items():
            assert abs(case.values[name] - value) <= 2.0 * u


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


def test_a_law_of_another_form_is_named_or_nothing_is() -> None:
    """The answer of a perfect analysis."""
    sound, other = (Planned(1, "pipe-exponent", one).make().answer for one in (False, True))
    assert (sound.verdict, sound.effects) == ("none", ())
    (planted,) = other.effects
    assert (other.verdict, planted.names) == ("named", ("line-exponent", "pump-exponent"))
    assert all(place.startswith(f"{MODULE}.") for place in planted.places)
