"""What is told in the end is the diagnosis of the whole, also where parts alone are updated."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.live import follower, limits
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import concluded, follow, nothing_yet
from rulec_runtime.recordings.recording import Recording, read_recording

from tests.conftest import ROOT, compiled
from tests.rig.follower import plants
from tests.rig.follower.agreement import differences, first_rows
from tests.rig.follower.plants import Planted, part_of, recorded


@functools.cache
def three_lines() -> Ruleset:
    """Three small plants in one file."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plants, "LINES", 3)
        return plants.side_by_side()


def with_faults(planted: list[Planted], rows: int = 160) -> Recording:
    """A recording of the three."""
    return recorded(three_lines(), rows, planted, 0.1, np.random.default_rng(2))


LEAK = Planted("L1A.leakage", 0.3, 80, 120)


@pytest.fixture
def updates(monkeypatch: pytest.MonkeyPatch) -> list[list[int]]:
    """Plants count as large; the parts that got each partial update."""
    monkeypatch.setattr(limits, "SMALL_PLANT", 5)
    seen: list[list[int]] = []

    def noted(*given: object) -> object:
        seen.append(list(given[3]))  # type: ignore[call-overload]
        return known(*given)  # type: ignore[arg-type]

    known = follower.partial_update
    monkeypatch.setattr(follower, "partial_update", noted)
    return seen


def by_rows(rules: Ruleset, recording: Recording, known: int) -> list[Event]:
    """A block of rows, and what is told of those that come one by one."""
    memory, events = nothing_yet(False), list[Event]()
    for first, last in [(0, known), *((row, row + 1) for row in range(known, len(recording)))]:
        for told in follow(rules, memory, part_of(recording, first, last)):
            memory = told.memory
            events += told.events
    end = concluded(rules, memory)
    assert end is not None
    assert end.diagnosis.findings == diagnose(recording, rules).findings
    return [*events, *end.events]


@pytest.mark.parametrize(
    ("plant", "name"), [("abc", "leakage_A.csv"), ("abc", "swapped.csv"), ("abc", "warm_A.csv")]
)
def test_examples_agree_row_by_row(plant: str, name: str, updates: list[list[int]]) -> None:
    rules = compiled(plant)
    recording = read_recording(ROOT / "plants" / plant / "examples" / name, rules)
    assert differences(rules, first_rows(recording, 25), 1) == []
    assert updates != []


def test_only_the_part_that_moves_is_judged(updates: list[list[int]]) -> None:
    """Once all rows of a first look have been judged; a fault begins and ends in its part."""
    rules, recording = three_lines(), with_faults([LEAK], 130)
    events = by_rows(rules, recording, LEAK.first)
    told = [(e.what, e.episode.subject) for e in events if e.episode.kind == "fault"]
    assert told == [("began", LEAK.fault), ("ended", LEAK.fault)]
    assert events[0].time - recording.time[LEAK.first] <= 0.5
    assert updates.count([1]) > 5
    assert updates.count([1]) == len(updates)


def test_a_row_that_says_nothing_new_gets_no_look(updates: list[list[int]]) -> None:
    rules, recording = three_lines(), with_faults([])
    assert by_rows(rules, recording, 100) == []
    assert len(updates) < 10


def test_a_sensor_that_fails_is_looked_at(updates: list[list[int]]) -> None:
    """A reading that stands still needs a look at everything, which finds it stuck."""
    rules, recording = three_lines(), with_faults([])
    column = recording.values["L2B.dp"].copy()
    column[99:] = column[99]
    recording = replace(recording, values={**recording.values, "L2B.dp": column})
    events = by_rows(rules, recording, 100)
    (stuck,) = [e for e in events if e.episode.kind == "sensor"]
    assert (stuck.what, stuck.episode.subject) == ("began", "L2B.dp.stuck")
    assert stuck.time == pytest.approx(recording.time[99] + limits.STANDS_STILL * 0.1)
