"""Events for a sink that is gone for a while: nothing lost, nothing twice, told once."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest
from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.outbox import Outbox
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.journal.store import open_journal

from tests.live.journal.events import event, kept_in, story


class Frail:
    """A sink that can be broken; a clock that is set by hand."""

    place = "frail"

    def __init__(self) -> None:
        self.broken: Exception | None = None
        self.events: list[Event] = []
        self.state: bytes | None = None
        self.tries = 0
        self.now = 0.0
        self.said: list[str] = []

    def commit(
        self, plant: str, events: Sequence[Event], state: bytes | None, *, dated: bool
    ) -> None:
        self.tries += 1
        if self.broken is not None:
            raise self.broken
        self.events += events
        self.state = state or self.state

    def outbox(self, file: Path | None = None) -> Outbox:
        return Outbox(self, "abc", self.said.append, file=file, clock=lambda: self.now)

    def run(self, outbox: Outbox, seconds: float) -> None:
        """Let time pass as the thread would."""
        ends = self.now + seconds
        while self.now < ends:
            self.now = min(self.now + max(outbox.step(), 0.01), ends)


def test_a_minute_without_it(tmp_path: Path) -> None:
    sink, file = Frail(), tmp_path / "waiting.json"
    outbox = sink.outbox(file)
    outbox.put([event(1)], b"1")
    outbox.step()
    sink.broken = JournalTrouble("frail: gone")
    for number in range(2, 62):
        outbox.put([event(number)], str(number).encode())
        sink.run(outbox, 1.0)
    assert sink.said == ["frail: gone; events are kept and written when it works again"]
    assert sink.tries < 20  # it is asked less and less often
    assert outbox.pending == 60
    assert outbox.left == (61, b"61")
    sink.broken = None
    sink.run(outbox, limits.LAST_RETRY)
    assert sink.events == [event(n) for n in range(1, 62)]
    assert sink.state == b"61"
    assert len(sink.said) == 2
    assert sink.said[1].startswith("frail: written again after ")
    assert sink.said[1].endswith(", with 60 events that waited")
    assert not file.exists()


def test_what_waits_outlives_the_process(tmp_path: Path) -> None:
    """The next one writes it first; a file that was forgotten there changes nothing."""
    sink, file = Frail(), tmp_path / "waiting.json"
    sink.broken = JournalTrouble("frail: gone")
    killed = sink.outbox(file)
    killed.put(story(), b"4")
    killed.step()
    journal = open_journal(str(tmp_path / "j.db"))
    kept = file.read_bytes()
    for _ in range(2):
        again = Outbox(journal, "abc", sink.said.append, file=file)
        assert again.left == (4, b"4")
        again.start()
        assert again.close() == 0
        assert [entry.event for entry in journal.events()] == story()
        assert not file.exists()
        file.write_bytes(kept)
    with pytest.raises(JournalRefused, match=r"those of abc, not of xyz; move it away"):
        Outbox(journal, "xyz", sink.said.append, file=file)
    for text in (kept.replace(b"told", b"Told"), kept[:-20], b"[]", b'"x"', b"\xff"):
        file.write_bytes(text)
        with pytest.raises(JournalRefused, match="move it away"):
            Outbox(journal, "abc", sink.said.append, file=file)
    journal.close()


def test_what_is_refused_for_good_is_told_and_kept(tmp_path: Path) -> None:
    sink, file = Frail(), tmp_path / "waiting.json"
    outbox = sink.outbox(file)
    sink.broken = JournalRefused("abc is watched already")
    outbox.put(story(), b"4")
    outbox.step()
    sink.run(outbox, 60.0)
    assert sink.said == ["abc is watched already"]
    assert sink.tries == 1
    with pytest.raises(JournalRefused, match="watched already"):
        outbox.put([event(5)], b"5")
    assert outbox.close() == 4
    assert sink.outbox(file).pending == 4


def test_when_too_many_wait_no_more_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MOST_PENDING", 4)
    sink = Frail()
    outbox = sink.outbox()
    outbox.put(story(), b"4")
    with pytest.raises(JournalTrouble, match="4 events wait to be written, no more are taken"):
        outbox.put([event(5)], b"5")
    assert outbox.close() == 0
    assert sink.events == story()


def test_a_watcher_without_events_says_that_it_is_there() -> None:
    sink = Frail()
    outbox = sink.outbox()
    sink.run(outbox, 60.0)
    assert 10 <= sink.tries <= 13
    assert sink.events == []


def test_disk_full(small_disk: Path) -> None:
    """For the journal and for what waits beside it: memory has it until there is room again."""
    journal = open_journal(str(small_disk / "j.db"))
    said: list[str] = []
    journal.commit("abc", [event(1)], b"1")
    ballast = small_disk / "ballast"
    with suppress(OSError), ballast.open("wb", buffering=0) as file:
        while file.write(bytes(1024)):
            pass
    outbox = Outbox(journal, "abc", said.append, file=small_disk / "waiting.json")
    outbox.start()
    number = 1
    while not said and number < 2000:
        number += 1
        outbox.put([event(number)], str(number).encode())
        time.sleep(0.001)
    assert len(said) == 1
    assert "full" in said[0] or "disk" in said[0]
    ballast.unlink()
    assert outbox.close() == 0
    assert [entry.event for entry in journal.events()] == [event(n + 1) for n in range(number)]
    assert len(said) == 2
    assert kept_in(journal) == (number, str(number).encode())
    journal.close()
