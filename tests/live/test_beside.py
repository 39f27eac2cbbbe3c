"""Looks that go on beside the rows: what is told in the end, and that nothing waits for them."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field, replace

import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.parts import parts_of
from rulec_runtime.live import limits, state
from rulec_runtime.live.batches import judged
from rulec_runtime.live.beside import BackgroundUpdates
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import Memory, Update, follow, nothing_yet
from rulec_runtime.live.full_update import evaluated
from rulec_runtime.live.last_evaluation import Evaluation, PendingUpdate, UpdateUnderWay
from rulec_runtime.live.levels import far_after
from rulec_runtime.live.update_process import UpdateProcess, read, written
from rulec_runtime.recordings.recording import Recording

from tests.live.test_agreement import LEAK, three_lines, with_faults
from tests.rig.follower.plants import part_of


@dataclass
class Slow:
    """A look that has ended when it was asked for so many times."""

    rows: int
    result: Evaluation

    def found(self, wait: bool) -> Evaluation | None:
        self.rows -= 1
        return self.result if wait or self.rows < 0 else None

    def drop(self) -> None:
        """Nothing is kept of it."""


@dataclass
class SlowLooks:
    """Looks that take so many rows; how many rows had come when each began."""

    rows: int
    began: list[int] = field(default_factory=list)

    def begin(self, ruleset: Ruleset, memory: Memory, headers: bool) -> PendingUpdate:
        self.began.append(memory.count)
        return Slow(self.rows, evaluated(ruleset, memory, headers))


@pytest.fixture(autouse=True)
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three lines count as a large plant; none of them as a large part."""
    monkeypatch.setattr(limits, "SMALL_PLANT", 10)


def row_by_row(
    recording: Recording, first: int, looks: BackgroundUpdates | None, last: int | None = None
) -> Iterator[Update]:
    """A block of rows, and then one by one."""
    rules, memory = three_lines(), nothing_yet(False)
    rows = range(first, last or len(recording))
    for low, high in [(0, first), *((row, row + 1) for row in rows)]:
        for told in follow(rules, memory, part_of(recording, low, high), looks):
            memory = told.memory
            yield told


def active(memory: Memory) -> set[str]:
    return {one.subject for one in memory.episodes if one.active}


@pytest.mark.parametrize("rows", [0, 9])
def test_in_the_end_the_same_is_active(rows: int) -> None:
    """A look that began before a leakage and ends behind its beginning takes nothing back."""
    recording, looks = with_faults([replace(LEAK, last=160)], 130), SlowLooks(rows)
    told = [*row_by_row(recording, LEAK.first - 53, looks)]
    assert looks.began[0] == 3 * (LEAK.first - 53) == LEAK.first + 1
    events = [(e.what, e.episode.subject) for one in told for e in one.events]
    assert events == [("began", LEAK.fault)]
    assert told[-1].memory.known is not None
    assert told[-1].memory.known.count >= LEAK.first + 1
    in_place = [*row_by_row(recording, LEAK.first - 53, None)]
    assert active(told[-1].memory) == active(in_place[-1].memory) == {LEAK.fault}


def test_a_fault_of_a_large_part_is_told_by_a_look(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "SMALL_PLANT", 5)
    recording, looks = with_faults([LEAK], 130), SlowLooks(3)
    events = [e for one in row_by_row(recording, LEAK.first, looks) for e in one.events]
    faults = [(e.what, e.episode.subject) for e in events if e.episode.kind == "fault"]
    assert faults == [("began", LEAK.fault), ("ended", LEAK.fault)]
    assert LEAK.first + 1 in looks.began
    assert events[0].time - recording.time[LEAK.first] <= 1.0


def test_blocks_of_rows_tell_the_same_as_ever() -> None:
    rules, recording = three_lines(), with_faults([LEAK])
    told: list[list[Event]] = []
    for looks in (None, SlowLooks(2)):
        memory, events = nothing_yet(False), list[Event]()
        for first in range(0, len(recording), 80):
            for one in follow(rules, memory, part_of(recording, first, first + 80), looks):
                memory = one.memory
                events += one.events
        told.append(events)
        assert looks is None or not looks.began
    assert told[0] == told[1]
    assert told[0] != []


def test_memory_stays_bounded_and_state_is_that_of_the_rows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A look that would take for ever is waited for in the end."""
    for name, value in (("KEPT_ROWS", 40), ("MOST_ROWS", 100), ("ROWS_AT_A_GLANCE", 60)):
        monkeypatch.setattr(limits, name, value)
    rules, recording, looks = three_lines(), with_faults([], 115), SlowLooks(10_000)
    told = [*row_by_row(recording, 30, looks)]
    assert looks.began == [80]
    kept = [len(one.memory.recent) for one in told]
    assert max(kept) == 99
    assert kept[-1] < 80
    before = told[95 - 30].memory
    assert before.under_way is not None
    again, _ = state.from_bytes(rules, state.to_bytes(rules, before, {}), "x")
    assert again.under_way is None
    assert (again.count, len(again.recent)) == (before.count, len(before.recent))


def test_a_few_rows_hardly_tell_the_noise() -> None:
    assert far_after(3) > 100.0
    assert far_after(9) == pytest.approx(15.0, rel=0.05)  # Student's, 8 degrees of freedom
    assert far_after(1000) == pytest.approx(limits.MOVED, rel=0.01)


@pytest.fixture(scope="module")
def process() -> Iterator[UpdateProcess]:
    with closing(UpdateProcess(three_lines())) as running:
        yield running


def remembered() -> Memory:
    (told,) = row_by_row(with_faults([LEAK], 100), 100, None)
    return told.memory


def test_the_process_finds_the_same(process: UpdateProcess) -> None:
    rules, memory = three_lines(), remembered()
    there = process.begin(rules, memory).found(wait=True)
    here = evaluated(rules, memory)
    assert there is not None
    assert there.diagnosis.ruleset is rules
    assert there.diagnosis.findings == here.diagnosis.findings != ()
    assert there.settled == here.settled


def test_what_both_processes_have_is_never_sent() -> None:
    rules, memory = three_lines(), remembered()
    found = evaluated(rules, memory)
    data = written(rules, found)
    again = read(rules, data)
    assert isinstance(again, Evaluation)
    assert again.known is not None
    assert again.known.parts[1].part is parts_of(rules)[1]
    assert again.known.diagnosis.findings[0].fault is found.diagnosis.findings[0].fault
    assert len(data) < 0.2 * len(rules.to_json())


def test_what_a_look_raises_is_raised_where_rows_are(process: UpdateProcess) -> None:
    rules, memory = three_lines(), remembered()
    broken = replace(memory, before="no history")  # type: ignore[arg-type]
    asked = process.begin(rules, broken)
    assert memory.known is not None
    with pytest.raises(AttributeError):
        asked.found(wait=True)
    assert process.begin(rules, memory).found(wait=True) is not None


def test_a_look_whose_process_is_killed_is_done_here(process: UpdateProcess) -> None:
    rules, memory = three_lines(), remembered()
    assert process.begin(rules, memory).found(wait=True) is not None
    assert process.pid is not None
    os.kill(process.pid, signal.SIGSTOP)
    asked = process.begin(rules, memory)
    assert asked.found(wait=False) is None
    os.kill(process.pid, signal.SIGKILL)
    found = asked.found(wait=True)
    assert found is not None
    assert found.diagnosis.findings == evaluated(rules, memory).diagnosis.findings


def test_closing_waits_for_no_look() -> None:
    with closing(UpdateProcess(three_lines())) as process:
        asked = process.begin(three_lines(), remembered())
        assert process.pid is not None
        os.kill(process.pid, signal.SIGSTOP)
        since = time.monotonic()
        asked.drop()
    assert time.monotonic() - since < 3.0
    assert process.pid is None


def test_a_look_that_ends_while_no_row_comes_is_told() -> None:
    recording, looks = with_faults([LEAK], 100), SlowLooks(0)
    (told,) = row_by_row(recording, 100, None)
    memory = replace(told.memory, episodes=())
    asked = looks.begin(three_lines(), memory, headers=True)
    memory = replace(memory, under_way=UpdateUnderWay(asked=asked, count=100, kept=100))
    ((after, events, diagnosis),) = judged(three_lines(), memory, [], looks)
    assert [e.episode.subject for e in events] == [LEAK.fault]
    assert after.under_way is None
    assert diagnosis is not None
    assert not [*judged(three_lines(), after, [], looks)]
