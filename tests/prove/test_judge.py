"""An answer held against what was planted: names, places and what is left open."""

from dataclasses import replace
from typing import Any

import pytest

from rulec.prove.judge import judge
from rulec.prove.results import Claim, Judged
from rulec.prove.truth.sealed import Planted
from tests.prove.made import LEAK, sealed

LOW = replace(LEAK, sort="sensor", module="B", place="sensor", names=("slope",), places=("B.dp",))


def effect(
    name: str, id_: str, location: str, probability: float = 1.0, **more: Any
) -> dict[str, Any]:
    """A finding as `--json` tells it."""
    usual: dict[str, Any] = {"modules": ["B"], "alternatives": (), "parameters": {}, "periods": []}
    own = {"effect": name, "id": id_, "module": "B", "place": location, "probability": probability}
    return {**usual, **own, **more}


def scored(*effects: dict[str, Any], planted: Planted = LOW) -> Judged:
    """How an answer is judged where that was planted."""
    form = {"verdict": "ambiguous", "effects": effects, "locations": ()}
    return judge(sealed(planted, "sensor"), form)


def other(name: str, id_: str, probability: float) -> dict[str, Any]:
    return {"effect": name, "id": id_, "probability": probability, "title": name}


def leak(probability: float = 1.0, second: float | None = None) -> dict[str, Any]:
    """A false name, and the right one as likely as that beside it."""
    left = () if second is None else (other("slope", "B.dp.low", second),)
    return effect("leakage", "B.leakage", "pump", probability, alternatives=left)


RIGHT = effect("slope", "B.dp.low", "dp")


@pytest.mark.parametrize(
    ("effects", "name", "location"),
    [
        ((RIGHT,), 1.0, 1.0),
        # One of two counts half with its place, where it is likely enough to be told in the
        # headline, and none stands alone there.
        ((leak(0.5, 0.4),), 0.5, 0.5),
        ((leak(0.5, 0.09),), 0.0, 0.0),
        ((leak(0.89, 0.11),), 0.5, 0.5),
        ((leak(0.9, 0.11),), 0.0, 0.0),
        # A false name beside counts as a miss of the names; the place was told all the same.
        ((RIGHT, leak()), 0.5, 1.0),
        ((effect("slope", "A.dp.low", "dp", module="A", modules=["A"]),), 0.0, 0.0),
    ],
    ids=["right", "one of two", "unlikely", "open", "told alone", "false beside", "other module"],
)
def test_shares_of_names_and_places(
    effects: tuple[dict[str, Any], ...], name: float, location: float
) -> None:
    found = scored(*effects)
    assert (name, location) == (found.name_right, found.place_right)


def test_names_that_say_the_same_count_together() -> None:
    """A dead band of a pump in proportion to its signal is a constant loss: both are right."""
    same = replace(LOW, sort="physics", names=("dead-band", "loss"), places=("B.Q",))
    left = (other("loss", "B.loss", 0.4), other("leak", "B.leak", 0.2))
    both = effect("dead-band", "B.dead-band", "Q", 0.5, alternatives=left[:1])
    three = effect("dead-band", "B.dead-band", "Q", 0.4, alternatives=left)
    assert 1.0 == scored(both, planted=same).name_right
    assert scored(three, planted=same).name_right == pytest.approx(2 / 3)


def test_every_name_is_kept_with_its_probability() -> None:
    """A name that leaves others open too; a curve without a name is none."""
    left = (other("leakage", "B.leakage", 0.3),)
    found = scored(
        effect("slope", "B.dp.low", "dp", 0.6, alternatives=left, sort="sensor"),
        effect("leakage", "B.leakage", "pump", 0.95, sort="fault"),
        effect("free-form", "B.loss", "loss", 0.8, sort="free"),
    )
    assert (Claim(0.6, True), Claim(0.95, False)) == found.claims
