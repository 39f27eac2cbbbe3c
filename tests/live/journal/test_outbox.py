"""Events and acknowledgements for a sink that is gone: nothing lost, nothing twice, told once."""

import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.commands.watch_opened import BufferedJournal
from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.outbox import Outbox, spill_beside
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.journal.store import open_journal
from rulec_runtime.live.memory import nothing_yet
from rulec_runtime.live.moment import Present

from tests.conftest import compiled
from tests.live.journal.events import LEAKAGE, event, story


class Frail:
    """A sink that can be broken; a clock that is set by hand."""

    address = "frail"

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
    """A watcher without events says every few seconds that it is there."""
    sink, file = Frail(), tmp_path / "waiting.json"
    outbox = sink.outbox(file)
    sink.run(outbox, 60.0)
    assert 10 <= sink.tries <= 13
    assert sink.events == []
    outbox.put([event(1)], b"1")
    outbox.step()
    sink.broken, sink.tries = JournalTrouble("frail: gone"), 0
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
    """At its end all is in the file, also if that was written a moment ago. The next one writes it
    first; a file that was forgotten there changes nothing."""
    sink, file = Frail(), tmp_path / "waiting.json"
    sink.broken = JournalTrouble("frail: gone")
    outbox = sink.outbox(file)
    for number in (2, 4):
        outbox.put(story()[number - 2 : number], b"%d" % number)
        outbox.step()
    assert sink.outbox(file).left == (2, b"2")  # what a kill would leave
    assert outbox.close(0.0) == 4
    kept = file.read_bytes()
    with closing(open_journal(str(tmp_path / "j.db"))) as journal:
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


def test_refused_for_good(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What waited is written by the next one, and still tells how fast a fault grows."""
    growing = event(1, replace(LEAKAGE, growth={"rate": 1e-4, "reaches": None}))
    monkeypatch.setattr(limits, "MOST_PENDING", 4)
    sink, file = Frail(), tmp_path / "waiting.json"
    outbox = sink.outbox(file)
    sink.broken = JournalRefused("abc is watched already")
    outbox.put([growing, *story()[1:]], b"4")
    with pytest.raises(JournalTrouble, match="4 events wait to be written, no more are taken"):
        outbox.put([event(5)], b"5")
    outbox.step()
    sink.run(outbox, 60.0)
    assert sink.said == ["abc is watched already"]
    assert sink.tries == 1
    with pytest.raises(JournalRefused, match="watched already"):
        outbox.put([event(5)], b"5")
    assert outbox.close() == 4
    sink.broken = None
    assert sink.outbox(file).close() == 0
    assert sink.events == [growing, *story()[1:]]


class FrailJournal:
    """A journal whose database can be gone."""

    def __init__(self, file: Path) -> None:
        self.journal = open_journal(str(file))
        self.gone = False

    def __getattr__(self, name: str) -> Any:
        if self.gone and name != "address":
            raise JournalTrouble("the database is gone")
        return getattr(self.journal, name)


@contextmanager
def noting(frail: FrailJournal, folder: Path) -> Iterator[tuple[BufferedJournal, Present]]:
    """A journal that a watch keeps, and the moment that shows what is acknowledged."""
    present = Present(compiled("abc"), "x", nothing_yet(True))
    with ExitStack() as stack:
        buffered = BufferedJournal(frail, "j", "abc", folder, stack, [])  # type: ignore[arg-type]
        buffered.joined_to(present)
        yield buffered, present


def noted(frail: FrailJournal) -> list[tuple[str, str | None, float | None]]:
    """Which episodes somebody has taken note of, who, and when."""
    entries = [e for e in frail.journal.events("abc") if e.by]
    return sorted({(entry.event.episode.id, entry.by, entry.at) for entry in entries})


def test_what_was_acknowledged_outlives_a_kill_while_the_database_is_gone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who and when stay as they were; once it is written nothing is left. An episode that is not
    there is told, and so is a file of something else."""
    monkeypatch.setattr(limits, "BUSY", 0.5)
    frail, begin, file = (
        FrailJournal(tmp_path / "j.db"),
        time.time(),
        spill_beside(tmp_path / "j", "abc"),
    )
    frail.journal.commit("abc", story(), b"4")
    frail.gone = True
    with noting(frail, tmp_path) as (kept, _):
        kept.sink.note(LEAKAGE.id, "Ann")
        kept.sink.note(LEAKAGE.id, "Ben")
        end = time.time()
    assert "1 acknowledgement could not be written" in capsys.readouterr().err
    left = file.read_bytes()
    with noting(frail, tmp_path) as (_, present):
        assert present.now().acknowledged == {LEAKAGE.id}  # shown at once
        frail.gone = False
    assert not file.exists()
    ((episode, by, at),) = before = noted(frail)
    assert (episode, by) == (LEAKAGE.id, "Ann")
    assert at is not None
    assert begin <= at <= end
    file.write_bytes(left)  # killed before it was taken away
    capsys.readouterr()
    with noting(frail, tmp_path) as (again, _):
        again.sink.note("X@0", "Ann")
    assert "holds no episode X@0" in capsys.readouterr().err
    assert noted(frail) == before
    assert not file.exists()
    file.write_text("[]")
    with pytest.raises(JournalRefused, match="move it away"), noting(frail, tmp_path):
        pass
    frail.journal.close()
