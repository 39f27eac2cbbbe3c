"""What is committed is there, once, with the state that belongs to it; so in a file of lines."""

import math
import sqlite3
from collections.abc import Iterator
from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path

import pytest
from rulec_runtime.live.journal import store
from rulec_runtime.live.journal.lines import LinesFile
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.journal.store import Journal, open_journal

from tests.hostile.texts import STEERING
from tests.live.journal.events import LEAKAGE, event, events_in, stored_in, story


@pytest.fixture
def journal(where: str) -> Iterator[Journal]:
    with closing(open_journal(where)) as opened:
        yield opened


def numbers(journal: Journal, **which: object) -> list[int]:
    return [entry.event.number for entry in journal.events(**which)]  # type: ignore[arg-type]


def test_what_is_committed_is_there_once_with_its_state(
    journal: Journal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of another event under the same number nothing is kept, nor of what came along; nor are
    events whose state cannot be kept."""
    journal.commit("abc", story(), b"\0new")
    journal.commit("abc", story()[:2], b"old")
    entries = list(journal.events("abc"))
    assert [entry.event for entry in entries] == story()
    assert entries[0].iso == "2023-11-14T22:13:21+00:00"
    assert stored_in(journal) == (4, b"\0new")
    journal.commit("abc", (), b"later")
    with pytest.raises(JournalRefused, match=r"another event 4 of abc.*'B.p healthy again'"):
        journal.commit("abc", [event(5), event(4)], b"other")
    with monkeypatch.context() as patch:
        patch.setattr(store, "clock", lambda _: 1 / 0)  # between the events and the state
        with pytest.raises(ZeroDivisionError):
            journal.commit("abc", [event(5)], b"lost")
    assert numbers(journal) == [1, 2, 3, 4]
    assert stored_in(journal) == (4, b"later")
    assert journal.state("xyz") is None
    journal.commit("xyz", [event(4)], None)  # another plant counts for itself
    assert journal.last("xyz") == 4
    assert journal.plants() == ("abc", "xyz")


def test_filters_and_acknowledgement(journal: Journal) -> None:
    """The first to acknowledge stays."""
    journal.commit("abc", story(), None)
    for found, which in (
        ([2, 4], {"kind": ("sensor",)}),
        ([1, 3], {"status": ("S", "F")}),
        ([3], {"active": True}),
        ([2, 3], {"since": 1.7e9 + 2, "until": 1.7e9 + 3}),
        ([3, 4], {"limit": 2}),
        ([], {"plant": "xyz"}),
    ):
        assert numbers(journal, **which) == found
    assert journal.acknowledge("abc", LEAKAGE.id, "Ann")
    assert not journal.acknowledge("abc", LEAKAGE.id, "Ben")
    assert journal.acknowledged("abc") == {LEAKAGE.id}
    assert [entry.by for entry in journal.events("abc")] == ["Ann", None, "Ann", None]
    with pytest.raises(JournalRefused, match="needs a name"):
        journal.acknowledge("abc", LEAKAGE.id, " ")


def test_texts_that_no_database_keeps_are_kept_as_far_as_can_be(journal: Journal) -> None:
    """Null characters and halves of pairs are replaced; numbers that are none come back as such."""
    text = "".join(STEERING.values()) + "\0\ud800'); DROP TABLE events; --"
    odd = replace(LEAKAGE, text=text, upper=math.inf, alternatives=((text, 0.5),))
    for _ in range(2):
        journal.commit("abc", [event(1, odd)], None)
    (entry,) = journal.events()
    assert entry.event.episode.text == text.replace("\0", "\ufffd").replace("\ud800", "\ufffd")
    assert math.isnan(entry.event.episode.upper)


def test_a_second_watcher_is_refused(journal: Journal, where: str) -> None:
    journal.take_lease("abc")
    with closing(open_journal(where)) as other:
        with pytest.raises(JournalRefused, match=r"abc is watched already: process \d+ on "):
            other.take_lease("abc")
        with pytest.raises(JournalRefused, match="watched already"):
            other.commit("abc", story(), None)
        other.commit("xyz", story(), None)
        journal.release("abc")
        other.take_lease("abc")
        with pytest.raises(JournalRefused, match="watched already"):
            journal.commit("abc", story(), None)  # who was replaced writes no more
        assert numbers(journal, plant="abc") == []


@pytest.mark.parametrize(
    ("change", "free"),
    [
        ("machine = 'elsewhere'", False),
        ("machine = 'elsewhere', expires = expires - 20", True),
        ("machine = 'elsewhere', expires = expires + 1000000", True),
        ("process = '1 0'", True),
    ],
    ids=["elsewhere, it may live", "elsewhere, silent", "elsewhere, far ahead", "here, killed"],
)
def test_lease_of_another_watcher_runs_out(change: str, free: bool, tmp_path: Path) -> None:
    file = tmp_path / "j.db"
    with closing(open_journal(str(file))) as journal, closing(open_journal(str(file))) as other:
        journal.take_lease("abc")
        with closing(sqlite3.connect(file)) as changed, changed:
            changed.execute(f"UPDATE watchers SET {change}")
        with nullcontext() if free else pytest.raises(JournalRefused, match="watched already"):
            other.take_lease("abc")


def test_what_is_no_journal(tmp_path: Path) -> None:
    text, foreign, later = (tmp_path / f"{name}.db" for name in ("text", "foreign", "later"))
    text.write_text("time,A.dp\n1,2\n" * 100)
    open_journal(str(later)).close()
    for file, change in (
        (foreign, "CREATE TABLE customers (name)"),
        (later, "UPDATE rulec_journal SET version = 99"),
    ):
        with closing(sqlite3.connect(file)) as made, made:
            made.execute(change)
    for where, words in (
        (str(text), "is no journal, nor any database"),
        (str(foreign), r"it holds tables of something else \(customers\)"),
        (str(later), "version 99, this rulec reads 1"),
        (str(tmp_path), "is no file"),
        (str(tmp_path / "no" / "j.db"), "there is no folder"),
        ("a\0b", "null"),
        ("mysql://root:secret@host/x", r"not mysql://$"),
        ("sqlite://", r"not sqlite://$"),
        ("postgresql://ann:secret@host:x/y", "cannot be read"),
    ):
        with pytest.raises(JournalRefused, match=words):
            open_journal(where)
    assert text.read_text().startswith("time")
    with closing(sqlite3.connect(foreign)) as database:
        assert database.execute("PRAGMA journal_mode").fetchone() == ("delete",)


def test_a_file_that_was_taken_away_is_noticed(tmp_path: Path) -> None:
    with closing(open_journal(str(tmp_path / "j.db"))) as journal:
        journal.commit("abc", story()[:2], None)
        for file in tmp_path.iterdir():
            file.rename(tmp_path / f"old-{file.name}")
        with pytest.raises(JournalTrouble):
            journal.commit("abc", story()[2:], None)


def test_each_event_once_and_half_a_line_is_cut_off(tmp_path: Path) -> None:
    file = tmp_path / "events.jsonl"
    sink = LinesFile(file)
    sink.commit("abc", story()[:2], None, dated=True)
    with pytest.raises(JournalRefused, match="another process"):
        LinesFile(file)
    sink.close()
    whole = file.read_bytes()
    file.write_bytes(whole + b'{"plant": "abc", "num')
    sink = LinesFile(file)
    assert file.read_bytes() == whole
    for _ in range(2):
        sink.commit("abc", story(), None, dated=True)
    assert events_in(file) == story()
    with pytest.raises(JournalRefused, match="another event 4 of abc"):
        sink.commit("abc", [event(4), event(5)], None, dated=True)
    sink.commit("xyz", [event(4)], None, dated=True)
    assert len(events_in(file)) == 5
    file.rename(tmp_path / "events.1.jsonl")  # as logs are put away
    text = "".join(STEERING.values()) + "\n"  # it steers no terminal and breaks no line
    sink.commit("abc", [event(5, text=text)], None, dated=False)
    sink.close()
    assert events_in(file) == [event(5, text=text)]
    assert file.read_text().removesuffix("\n").isprintable()


@pytest.mark.parametrize(
    "content",
    [b"time,A.dp\n1,2\n", b"\n", b"[1]\n", b"\xff\n", b"[" * 9999 + b"\n", b"note", b'{"x'],
)
def test_a_file_of_something_else_is_left_alone(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "other"
    file.write_bytes(content)
    with pytest.raises(JournalRefused, match=r"line( 1)? is no event; name another file"):
        LinesFile(file)
    assert file.read_bytes() == content
