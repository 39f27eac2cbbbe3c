"""Lost by the search, or not in the readings: the true laws refitted beside the answer."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from rulec.engines.call import Engine
from rulec.prove.analyst import FORM
from rulec.prove.campaign import OPENED, judged, sealed
from rulec.prove.partition import Partition
from rulec.prove.refit import (
    EVIDENCE,
    FOUND,
    READINGS,
    SEARCH,
    Refitted,
    lost_in,
    refitted,
)
from rulec.prove.run_folder import CASES

FIRST = Partition("development", 1, quick=True, only="single-static-head-0")
"""The first case of one effect."""

NOTHING = {"verdict": "none", "effects": [], "seconds": 1.0}


def quiet(what: str, done: int, all_: int) -> None:
    """Nobody watches."""


def told(true: float, found: float, least: float = 20.0) -> Refitted:
    return Refitted(
        case="it", true=true, reported=found, needed=least, laws=("A.slip",), names=("A.loss",)
    )


@pytest.mark.parametrize(
    ("one", "held"),
    [
        (told(60.0, 50.0), True),
        (told(52.0, 50.0), False),
        (told(18.0, 0.0), False),
        (told(50.0, 60.0), False),
    ],
    ids=["leads", "no lead", "too small", "behind"],
)
def test_the_true_laws_must_lead_and_be_worth_telling(one: Refitted, held: bool) -> None:
    assert held == one.is_lost_by_the_search
    assert ("lost by the search" in one.summary) == held


@pytest.mark.parametrize(
    ("one", "reason"),
    [
        (replace(told(50.0, 50.0), names=("A.slip", "B.slip")), FOUND),
        (told(60.0, 50.0), SEARCH),
        (replace(told(50.0, 60.0), at_best=0.9), EVIDENCE),
        (replace(told(50.0, 60.0), at_best=0.1), READINGS),
    ],
)
def test_a_name_is_lost_for_one_reason(one: Refitted, reason: str) -> None:
    """Found and left open, not tried, tried and outbid, or seen by nobody."""
    assert one.reason == reason


@pytest.mark.prove
@pytest.mark.usefixtures("in_this_process")
def test_the_true_laws_are_refitted_beside_what_is_told(tmp_path: Path) -> None:
    """A name that a recorded answer lacks is found as lost; the search of today has it."""
    seals = sealed(FIRST, tmp_path, Engine(), quiet)
    folder = min((tmp_path / CASES).iterdir())
    assert [] == lost_in(tmp_path)
    for each in (tmp_path / CASES).iterdir():
        (each / FORM).write_text(json.dumps(NOTHING), encoding="utf-8")
    judged(FIRST, tmp_path, seals, Engine(), quiet)
    assert (folder / OPENED).exists()
    assert folder in lost_in(tmp_path)
    one = refitted(folder)
    assert one.laws == one.names
    assert one.true == pytest.approx(one.reported, abs=0.01)
    assert one.true > one.needed
    assert not one.is_lost_by_the_search
    assert one.reason == FOUND
    assert one.probability == pytest.approx(1.0, abs=0.1)
    # Sealed with a strength of 737 and a margin of 552: no other law comes near.
    assert one.at_best == pytest.approx(1.0, abs=0.01)
