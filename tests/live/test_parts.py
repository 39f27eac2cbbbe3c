"""Plants in parts: what moves alone is judged."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.live import follower, limits
from rulec_runtime.live.episode import Event
from rulec_runtime.recordings.recording import Recording

from tests.live.test_follower import events_of, followed, recording_of
from tests.rig.follower import plants
from tests.rig.follower.agreement import differences, first_rows
from tests.rig.follower.plants import Planted, recorded

LEAK = Planted("L1A.leakage", 0.3, 80, 120)


@functools.cache
def three_lines() -> Ruleset:
    """Three small plants in one file."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plants, "LINES", 3)
        return plants.side_by_side()


def with_faults(planted: list[Planted], rows: int = 160) -> Recording:
    return recorded(three_lines(), rows, planted, 0.1, np.random.default_rng(2))


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


def by_rows(recording: Recording, known: int) -> list[Event]:
    """A block of rows, and what is told of those that come one by one, to the end."""
    told = followed(three_lines(), recording, range(known, len(recording) + 1))
    end = follower.concluded(three_lines(), told[-1].memory)
    assert end is not None
    assert end.diagnosis.findings == diagnose(recording, three_lines()).findings
    return events_of([*told, end])


def test_an_example_agrees_row_by_row(updates: list[list[int]]) -> None:
    rules, recording = recording_of("abc", "warm_A.csv")
    assert differences(rules, first_rows(recording, 25), 1) == []
    assert updates != []


def test_only_the_part_that_moves_is_judged(updates: list[list[int]]) -> None:
    """Once all rows of a first look have been judged; a fault begins and ends in its part."""
    recording = with_faults([LEAK], 130)
    events = by_rows(recording, LEAK.first)
    told = [(e.what, e.episode.subject) for e in events if e.episode.kind == "fault"]
    assert told == [("began", LEAK.fault), ("ended", LEAK.fault)]
    assert events[0].time - recording.time[LEAK.first] <= 0.5
    assert updates.count([1]) == len(updates) > 5


def test_nothing_new_gets_no_look_and_a_stuck_sensor_does(updates: list[list[int]]) -> None:
    """A reading that stands still needs a look at everything, which finds it stuck."""
    recording = with_faults([])
    assert by_rows(recording, 100) == []
    assert len(updates) < 10
    column = recording.values["L2B.dp"].copy()
    column[99:] = column[99]
    recording = replace(recording, values={**recording.values, "L2B.dp": column})
    (stuck,) = [e for e in by_rows(recording, 100) if e.episode.kind == "sensor"]
    assert (stuck.what, stuck.episode.subject) == ("began", "L2B.dp.stuck")
    assert stuck.time == pytest.approx(recording.time[99] + limits.STANDS_STILL * 0.1)
