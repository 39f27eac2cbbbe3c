"""An answer held against what was planted: names, places and what is left open."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rulec.prove.judge import judge
from rulec.prove.results import Claim, Judged
from rulec.prove.truth.sealed import Planted
from tests.prove.made import LEAK, sealed

LOW = replace(
    LEAK, sort="sensor", module="B", place="sensor", names=("slope",), places=("B.dp",), margin=3.0
)


def effect(
    name: str, id_: str, place: str, probability: float = 1.0, **more: Any
) -> dict[str, Any]:
    """A finding as `--json` tells it."""
    usual: dict[str, Any] = {"modules": ["B"], "alternatives": (), "parameters": {}, "periods": []}
    own = {"effect": name, "id": id_, "module": "B", "place": place, "probability": probability}
    return {**usual, **own, **more}


def scored(*effects: dict[str, Any], planted: Planted = LOW) -> Judged:
    """How an answer is judged where that was planted."""
    form = {"verdict": "ambiguous", "effects": effects, "locations": ()}
    return judge(SimpleNamespace(answer=sealed(planted, "sensor")), form, Path(), "development")  # type: ignore[arg-type]


def other(name: str, id_: str, probability: float) -> dict[str, Any]:
    return {"effect": name, "id": id_, "probability": probability, "title": name}


def test_names_that_say_the_same_count_together() -> None:
    """A dead band of a pump in proportion to its signal is a constant loss: both are right."""
    same = replace(LOW, sort="physics", names=("dead-band", "loss"), places=("B.Q",))
    left = (other("loss", "B.loss", 0.4), other("leak", "B.leak", 0.2))
    both = effect("dead-band", "B.dead-band", "Q", 0.5, alternatives=left[:1])
    three = effect("dead-band", "B.dead-band", "Q", 0.4, alternatives=left)
    assert 1.0 == scored(both, planted=same).name_right
    assert scored(three, planted=same).name_right == pytest.approx(2 / 3)


def test_a_right_name_at_the_right_place_counts_whole() -> None:
    found = scored(effect("slope", "B.dp.low", "dp"))
    assert (1.0, 1.0) == (found.name_right, found.place_right)


@pytest.mark.parametrize(("second", "counted"), [(0.4, 0.5), (0.09, 0.0)])
def test_one_of_two_counts_half_with_its_place(second: float, counted: float) -> None:
    """Where it is likely enough to be told in the headline."""
    left = other("slope", "B.dp.low", second)
    found = scored(effect("leakage", "B.leakage", "pump", 0.5, alternatives=(left,)))
    assert (counted, counted) == (found.name_right, found.place_right)


def test_a_name_counts_alone_from_the_probability_at_which_the_answer_tells_it_alone() -> None:
    left = (other("slope", "B.dp.low", 0.11),)
    sure, open_ = (effect("leakage", "B.leakage", "pump", p, alternatives=left) for p in (0.9, 0.8))
    assert (0.0, 0.5) == (scored(sure).name_right, scored(open_).name_right)


def test_every_name_is_kept_with_its_probability() -> None:
    """A name that leaves others open too; a curve without a name is none."""
    left = (other("leakage", "B.leakage", 0.3),)
    found = scored(
        effect("slope", "B.dp.low", "dp", 0.6, alternatives=left, sort="sensor"),
        effect("leakage", "B.leakage", "pump", 0.95, sort="fault"),
        effect("free-form", "B.loss", "loss", 0.8, sort="free"),
    )
    assert (Claim(0.6, True), Claim(0.95, False)) == found.claims


def test_a_false_name_beside_counts_as_a_miss() -> None:
    """Of the names; the place was told all the same."""
    found = scored(effect("slope", "B.dp.low", "dp"), effect("leakage", "B.leakage", "pump"))
    assert (0.5, 1.0) == (found.name_right, found.place_right)


def test_a_right_name_in_another_module_is_wrong() -> None:
    found = scored(effect("slope", "A.dp.low", "dp", module="A", modules=["A"]))
    assert (0.0, 0.0) == (found.name_right, found.place_right)
