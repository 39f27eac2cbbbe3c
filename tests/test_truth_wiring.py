"""Mistakes of wiring and files: what stands in the columns, and what a perfect analysis says."""

import functools

import numpy as np
import pytest

from rulec.prove.judge import judge
from rulec.prove.truth.settled.effect import WIRING
from rulec.prove.truth.settled.plan import Planned, SettledCase
from rulec.prove.truth.settled.suite import planned
from rulec.prove.truth.units import Array


@functools.cache
def made(effect: str) -> SettledCase:
    return Planned(
        f"mistake {effect}", "wiring", "dosing", "steps", (effect,), 2000.0, small=True
    ).make()


Columns = dict[str, Array]


def columns(effect: str) -> tuple[tuple[str, ...], Columns, Columns]:
    """Places of a mistake; what is recorded by place, with the mistake and as it should be, in the
    sensors' units."""
    case = made(effect)
    shown = (case.scene.recorded(case.scene.truly(t), t) for t in (case.terms, ()))
    wrong, right = ({h.partition(" [")[0]: v for h, v in c.items()} for c in shown)
    return case.answer.effects[0].places, wrong, right


@pytest.mark.parametrize(
    "effect",
    [e if i % 4 == 0 else pytest.param(e, marks=pytest.mark.prove) for i, e in enumerate(WIRING)],
)
def test_a_mistake_is_an_error_of_sensors_at_the_columns_that_are_wrong(effect: str) -> None:
    """Those columns and no others are wrong; the verdict is `sensor`."""
    places, wrong, right = columns(effect)
    off = {place for place in right if not np.array_equal(wrong[place], right[place])}
    assert off == set(places)
    assert len(off) == (2 if effect.startswith("swapped") else 1)
    assert made(effect).answer.verdict == "sensor"


@pytest.mark.parametrize("effect", ["unit-dp", "unit-power", "unit-speed"])
def test_a_column_in_another_unit_is_off_by_its_factor(effect: str) -> None:
    (place,), wrong, right = columns(effect)
    ratio = float(np.median(wrong[place] / right[place]))
    assert abs(ratio - 1.0) > 0.5
    assert wrong[place] == pytest.approx(ratio * right[place])


def test_other_columns_hold_what_the_mistake_says() -> None:
    """The other's readings, the other sign, the same later."""
    (one, other), wrong, right = columns("swapped-dp")
    assert np.array_equal(wrong[one], right[other])
    assert np.array_equal(wrong[other], right[one])
    (place,), wrong, right = columns("turned-dp")
    assert np.array_equal(wrong[place], -right[place])
    (place,), wrong, right = columns("late-speed")
    late, known = wrong[place], right[place]
    assert 2 <= next(k for k in range(1, known.size) if np.array_equal(late[k:], known[:-k])) <= 60


def test_a_name_counts_with_its_id_and_either_of_two_swapped_columns() -> None:
    """As the answer's JSON tells it."""
    case = made("swapped-dp")
    (planted,) = case.answer.effects
    for place, module in ((p, p.partition(".")[0]) for p in planted.places):
        found = {
            "effect": "swapped-columns", "id": f"{place}.swapped-columns", "module": module,
            "modules": [module], "place": "dp", "probability": 0.97, "alternatives": (),
            "parameters": {}, "sort": "sensor",
        }  # fmt: skip
        form = {"verdict": "sensor", "effects": (found,), "locations": ()}
        result = judge(case.answer, form)
        assert (1.0, 1.0, True) == (result.name_right, result.place_right, result.told_right)
        other = {**form, "effects": ({**found, "effect": "gain-error"},)}
        result = judge(case.answer, other)
        assert (0.0, 1.0) == (result.name_right, result.place_right)


def test_the_suite_draws_every_mistake() -> None:
    found = {case.effects[0] for case in planned(3, {"wiring": 2 * len(WIRING)})}
    assert found == set(WIRING)
