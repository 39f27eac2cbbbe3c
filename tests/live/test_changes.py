"""What was told too early, or too late, is set right when later readings say otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.live.changes import changes
from rulec_runtime.live.episode import Episode
from rulec_runtime.live.horizon import Horizon
from rulec_runtime.recordings.recording import read_recording

from tests.conftest import ROOT, compiled

Over = tuple[Ruleset, Diagnosis, Episode]

SIGHT = Horizon(since=0.0, until=400.0, settled=400.0, usual=60.0, time=np.arange(401.0), pause=5)


@pytest.fixture(scope="module")
def over() -> Over:
    """A diagnosis of one fault that has ended, 100 s to 200 s, and its episode."""
    rules = compiled("abc")
    path = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"
    whole = diagnose(read_recording(path, rules), rules)
    finding = next(f for f in whole.findings if not f.active)
    diagnosis = replace(whole, findings=(replace(finding, since=100.0, until=200.0),))
    (told,), events = changes(rules, (), diagnosis, SIGHT, 0)
    assert [e.what for e in events] == ["began", "ended"]
    return rules, diagnosis, told


def test_a_fault_that_ended_and_was_none_is_withdrawn_once(over: Over) -> None:
    rules, diagnosis, told = over
    none = replace(diagnosis, findings=())
    kept, events = changes(rules, (told,), none, SIGHT, 2)
    assert [(e.number, e.what, e.episode.id) for e in events] == [(3, "withdrawn", told.id)]
    assert changes(rules, kept, none, SIGHT, 3) == ((), ())


def test_what_can_be_seen_no_more_is_not_withdrawn(over: Over) -> None:
    rules, diagnosis, told = over
    later = replace(SIGHT, since=150.0, time=np.arange(150.0, 401.0))
    assert changes(rules, (told,), replace(diagnosis, findings=()), later, 2)[1] == ()


def test_two_that_turn_out_to_be_one_are_not_withdrawn(over: Over) -> None:
    rules, diagnosis, told = over
    pair = (replace(told, id="first", until=120.0), replace(told, id="second", since=160.0))
    assert "withdrawn" not in [e.what for e in changes(rules, pair, diagnosis, SIGHT, 2)[1]]


def test_a_fault_that_began_earlier_than_told_is_told_again(over: Over) -> None:
    rules, diagnosis, told = over
    kept, events = changes(rules, (replace(told, since=180.0),), diagnosis, SIGHT, 2)
    assert [(e.what, e.episode.since) for e in events] == [("changed", 100.0)]
    assert "earlier" in events[0].text
    assert changes(rules, kept, diagnosis, SIGHT, 3)[1] == ()
