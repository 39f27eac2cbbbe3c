"""Plants in parts: what moves alone is judged, and looks that go on beside the rows."""

import functools
import os
import signal
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady.independent_parts import parts_of
from rulec_runtime.live import follower, limits, state
from rulec_runtime.live.background_update import BackgroundUpdates
from rulec_runtime.live.batches import judged
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import Memory, Update
from rulec_runtime.live.full_update import evaluated
from rulec_runtime.live.last_evaluation import Evaluation, PendingUpdate, UpdateUnderWay
from rulec_runtime.live.levels import far_after
from rulec_runtime.live.update_process import UpdateProcess, read, written
from rulec_runtime.recordings.recording import Recording

from tests.live.test_follower import active, events_of, followed, recording_of
from tests.rig.follower import plants
from tests.rig.follower.agreement import differences, first_rows
from tests.rig.follower.plants import Planted, recorded


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


def rows(
    recording: Recording, first: int, looks: BackgroundUpdates | None = None, step: int = 1
) -> list[Update]:
    """A block of rows, and then one by one or in further blocks."""
    ends = range(first, len(recording) + step, step)
    return followed(three_lines(), recording, ends, looks)


def told_of(told: list[Update]) -> list[tuple[str, str]]:
    return [(e.what, e.episode.subject) for e in events_of(told)]


def test_in_the_end_the_same_is_active() -> None:
    """A look that began before a leakage and ends behind its beginning takes nothing back. Blocks
    of rows need none."""
    recording, looks = with_faults([replace(LEAK, last=160)], 130), SlowLooks(9)
    told = rows(recording, LEAK.first - 53, looks)
    assert looks.began[0] == 3 * (LEAK.first - 53) == LEAK.first + 1
    assert told_of(told) == [("began", LEAK.fault)]
    assert told[-1].memory.known is not None
    assert told[-1].memory.known.count >= LEAK.first + 1
    in_place = rows(recording, LEAK.first - 53)
    for memory in (told[-1].memory, in_place[-1].memory):
        assert [e.subject for e in active(memory)] == [LEAK.fault]
    unasked = SlowLooks(2)
    blocks = [rows(with_faults([LEAK]), 80, each, 80) for each in (None, unasked)]
    assert told_of(blocks[0]) == told_of(blocks[1]) != []
    assert unasked.began == []


def test_a_fault_of_a_large_part_is_told_by_a_look(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "SMALL_PLANT", 5)
    recording, looks = with_faults([LEAK], 130), SlowLooks(3)
    told = rows(recording, LEAK.first, looks)
    faults = [pair for pair in told_of(told) if pair[1] == LEAK.fault]
    assert faults == [("began", LEAK.fault), ("ended", LEAK.fault)]
    assert LEAK.first + 1 in looks.began
    assert events_of(told)[0].time - recording.time[LEAK.first] <= 1.0


def test_memory_stays_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A look that would take for ever is waited for in the end."""
    for name, value in (("KEPT_ROWS", 40), ("MOST_ROWS", 100), ("ROWS_AT_A_GLANCE", 60)):
        monkeypatch.setattr(limits, name, value)
    rules, recording, looks = three_lines(), with_faults([], 115), SlowLooks(10_000)
    told = rows(recording, 30, looks)
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


@pytest.fixture
def memory() -> Memory:
    return rows(with_faults([LEAK], 100), 100)[-1].memory


def test_the_process_finds_the_same(process: UpdateProcess, memory: Memory) -> None:
    """What both processes have is never sent."""
    rules, here = three_lines(), evaluated(three_lines(), memory)
    there = process.begin(rules, memory).found(wait=True)
    assert there is not None
    assert there.diagnosis.ruleset is rules
    assert there.diagnosis.findings == here.diagnosis.findings != ()
    assert there.settled == here.settled
    data = written(rules, here)
    again = read(rules, data)
    assert isinstance(again, Evaluation)
    assert again.known is not None
    assert again.known.parts[1].part is parts_of(rules)[1]
    assert len(data) < 0.2 * len(rules.to_json())


def test_a_look_that_fails_or_is_killed(process: UpdateProcess, memory: Memory) -> None:
    rules = three_lines()
    broken = replace(memory, before="no history")  # type: ignore[arg-type]
    asked = process.begin(rules, broken)
    with pytest.raises(AttributeError):
        asked.found(wait=True)
    assert process.begin(rules, memory).found(wait=True) is not None
    assert process.pid is not None
    os.kill(process.pid, signal.SIGSTOP)
    asked = process.begin(rules, memory)
    assert asked.found(wait=False) is None
    os.kill(process.pid, signal.SIGKILL)
    found = asked.found(wait=True)
    assert found is not None
    assert found.diagnosis.findings == evaluated(rules, memory).diagnosis.findings


def test_a_look_that_ends_while_no_row_comes_is_told(memory: Memory) -> None:
    looks, memory = SlowLooks(0), replace(memory, episodes=())
    asked = looks.begin(three_lines(), memory, headers=True)
    memory = replace(memory, under_way=UpdateUnderWay(asked=asked, count=100, kept=100))
    ((after, events, diagnosis),) = judged(three_lines(), memory, [], looks)
    assert [e.episode.subject for e in events] == [LEAK.fault]
    assert after.under_way is None
    assert diagnosis is not None
    assert not [*judged(three_lines(), after, [], looks)]


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
    told = rows(recording, known)
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
