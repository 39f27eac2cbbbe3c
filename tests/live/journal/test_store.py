"""What is committed is there, once, with the state that belongs to it."""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble, needs
from rulec_runtime.live.journal.store import Journal, open_journal

from tests.hostile.texts import STEERING
from tests.live.journal.events import LEAKAGE, event, kept_in, story


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    opened = open_journal(str(tmp_path / "j.db"))
    yield opened
    opened.close()


def numbers(journal: Journal, **which: object) -> list[int]:
    return [entry.event.number for entry in journal.events(**which)]  # type: ignore[arg-type]


def test_what_is_committed_comes_back(journal: Journal) -> None:
    journal.commit("abc", story(), b"state")
    entries = list(journal.events("abc"))
    assert [entry.event for entry in entries] == story()
    assert entries[0].iso == "2023-11-14T22:13:21+00:00"
    assert kept_in(journal) == (4, b"state")
    assert journal.state("other") is None
    assert journal.plants() == ("abc",)


def test_the_same_again_is_written_once(journal: Journal) -> None:
    journal.commit("abc", story(), b"new")
    journal.commit("abc", story()[:2], b"old")
    assert numbers(journal) == [1, 2, 3, 4]
    assert kept_in(journal)[1] == b"new"
    journal.commit("abc", (), b"later")
    assert kept_in(journal) == (4, b"later")


def test_another_event_of_a_number_is_refused_with_all_that_came_along(journal: Journal) -> None:
    journal.commit("abc", story(), b"state")
    with pytest.raises(JournalRefused, match=r"another event 4 of abc.*'B.p healthy again'"):
        journal.commit("abc", [event(5), event(4)], b"other")
    assert numbers(journal) == [1, 2, 3, 4]
    assert kept_in(journal)[1] == b"state"
    journal.commit("xyz", [event(4)], None)  # another plant counts for itself
    assert journal.last("xyz") == 4


def test_filters(journal: Journal) -> None:
    journal.commit("abc", story(), None)
    assert numbers(journal, kind=("sensor",)) == [2, 4]
    assert numbers(journal, status=("S", "F")) == [1, 3]
    assert numbers(journal, active=True) == [3]
    assert numbers(journal, since=1.7e9 + 2, until=1.7e9 + 3) == [2, 3]
    assert numbers(journal, limit=2) == [3, 4]
    assert numbers(journal, plant="xyz") == []


def test_first_to_acknowledge_stays(journal: Journal) -> None:
    journal.commit("abc", story(), None)
    assert journal.acknowledge("abc", LEAKAGE.id, "Ann")
    assert not journal.acknowledge("abc", LEAKAGE.id, "Ben")
    assert journal.acknowledged("abc") == {LEAKAGE.id}
    assert [entry.by for entry in journal.events("abc")] == ["Ann", None, "Ann", None]
    with pytest.raises(JournalRefused, match="no episode x of abc"):
        journal.acknowledge("abc", "x", "Ann")
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


def test_a_second_watcher_is_refused(journal: Journal, tmp_path: Path) -> None:
    journal.hold("abc")
    other = open_journal(str(tmp_path / "j.db"))
    with pytest.raises(JournalRefused, match=r"abc is watched already: process \d+ on "):
        other.hold("abc")
    with pytest.raises(JournalRefused, match="watched already"):
        other.commit("abc", story(), None)
    other.commit("xyz", story(), None)
    journal.release("abc")
    other.hold("abc")
    with pytest.raises(JournalRefused, match="watched already"):
        journal.commit("abc", story(), None)  # who was replaced writes no more
    assert numbers(journal, plant="abc") == []
    other.close()


def test_lease_of_another_machine_runs_out(journal: Journal, tmp_path: Path) -> None:
    """Nobody can look whether a process lives there; nor is a lease far ahead believed."""
    journal.hold("abc")
    other = open_journal(str(tmp_path / "j.db"))
    with sqlite3.connect(tmp_path / "j.db") as changed:
        changed.execute("UPDATE watchers SET machine = 'elsewhere'")
    with pytest.raises(JournalRefused, match="watched already"):
        other.hold("abc")
    for change in ("expires - 20", "expires + 1000000"):
        with sqlite3.connect(tmp_path / "j.db") as changed:
            changed.execute(f"UPDATE watchers SET machine = 'elsewhere', expires = {change}")
        other.hold("abc")
    changed.close()
    other.close()


def test_what_is_no_journal(tmp_path: Path) -> None:
    text = tmp_path / "text.db"
    text.write_text("time,A.dp\n1,2\n" * 100)
    foreign = tmp_path / "foreign.db"
    with sqlite3.connect(foreign) as made:
        made.execute("CREATE TABLE customers (name)")
    later = tmp_path / "later.db"
    open_journal(str(later)).close()
    with sqlite3.connect(later) as made:
        made.execute("UPDATE rulec_journal SET version = 99")
    made.close()
    for where, words in (
        (str(text), "is no journal, nor any database"),
        (f"sqlite:///{foreign}", r"it holds tables of something else \(customers\)"),
        (str(later), "version 99, this rulec reads 1"),
        (str(tmp_path), "is no file"),
        (str(tmp_path / "no" / "j.db"), "there is no such folder"),
        ("a\0b", "null"),
        ("mysql://root:secret@host/x", r"not mysql://$"),
        ("sqlite://", "needs a file"),
        ("postgresql://ann:secret@host:x/y", "cannot be read"),
    ):
        with pytest.raises(JournalRefused, match=words):
            open_journal(where)
    with pytest.raises(JournalRefused, match="there is no journal"):
        open_journal(str(tmp_path / "none.db"), make=False)
    assert not (tmp_path / "none.db").exists()
    assert text.read_text().startswith("time")
    with sqlite3.connect(foreign) as kept:
        assert kept.execute("PRAGMA journal_mode").fetchone() == ("delete",)
    kept.close()


def test_a_server_that_does_not_answer_is_trouble_and_keeps_its_password() -> None:
    with pytest.raises(JournalTrouble, match="refused") as told:
        open_journal("postgresql://ann:secret@127.0.0.1:1/plants")
    assert "secret" not in str(told.value)


def test_a_file_that_was_taken_away_is_noticed(journal: Journal, tmp_path: Path) -> None:
    journal.commit("abc", story()[:2], None)
    for file in tmp_path.iterdir():
        file.rename(tmp_path / f"old-{file.name}")
    with pytest.raises(JournalTrouble):
        journal.commit("abc", story()[2:], None)


def test_a_package_that_is_not_there() -> None:
    needs("sqlalchemy", "journal")
    with pytest.raises(JournalRefused, match=r"pip install 'rulec-runtime\[journal\]'"):
        needs("no_such_package", "journal")
