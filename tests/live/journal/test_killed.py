"""`kill -9` while it writes: nothing lost of what was told as written, nothing twice."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from rulec_runtime.live.journal.store import open_journal

from tests.live.journal.events import event, kept_in
from tests.live.journal.killed import Commit, written_until_killed


def journal_at(where: str) -> tuple[int, Commit]:
    """A journal as a watcher that starts again finds it."""
    journal = open_journal(where)
    journal.hold("abc")  # at once, though the one before was killed
    return journal.last("abc"), partial(journal.commit, "abc")


def check_journal(where: str, kills: int) -> None:
    told = written_until_killed(partial(journal_at, where), kills)
    journal = open_journal(where)
    found = [entry.event for entry in journal.events("abc")]
    assert found == [event(n + 1) for n in range(len(found))]
    assert told <= len(found) <= told + 1  # killed between writing and telling
    number, state = kept_in(journal)
    assert number == int(state) == len(found)
    journal.close()


def test_sqlite(tmp_path: Path) -> None:
    check_journal(str(tmp_path / "j.db"), 20)
