"""Acknowledgements while the database is gone: kept beside the events that wait."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.live.journal.notes import Notes
from rulec_runtime.live.journal.outbox import Outbox
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.journal.store import open_journal

from tests.live.journal.events import LEAKAGE, story


class Frail:
    """A journal whose database can be gone."""

    def __init__(self, file: Path) -> None:
        self.journal = open_journal(str(file))
        self.gone = False

    def __getattr__(self, name: str) -> Any:
        if self.gone and name != "place":
            raise JournalTrouble("the database is gone")
        return getattr(self.journal, name)


@pytest.fixture
def frail(tmp_path: Path) -> Iterator[Frail]:
    found = Frail(tmp_path / "j.db")
    yield found
    found.journal.close()


@contextmanager
def noting(frail: Frail, waiting: Path | None) -> Iterator[tuple[Notes, set[str], list[str]]]:
    """Notes, episodes that are shown as acknowledged, and what was said."""
    seen, said = set[str](), list[str]()
    outbox = Outbox(frail, "abc", said.append, file=waiting)  # type: ignore[arg-type]
    notes = Notes(frail, outbox, "abc", said.append, seen.update)  # type: ignore[arg-type]
    with closing(notes):
        yield notes, seen, said


def noted(frail: Frail) -> dict[str, tuple[str | None, float | None]]:
    """Who has taken note of which episode, and when."""
    entries = [e for e in frail.journal.events("abc") if e.by]
    return {entry.event.episode.id: (entry.by, entry.at) for entry in entries}


def test_what_was_acknowledged_outlives_a_kill_while_the_database_is_gone(
    frail: Frail, tmp_path: Path
) -> None:
    """Who and when stay as they were; once it is written nothing is left."""
    waiting, begin = tmp_path / "j.waiting.json", time.time()
    frail.journal.commit("abc", story(), b"4")
    frail.gone = True
    with noting(frail, waiting) as (notes, _, _):
        notes.put(LEAKAGE.id, "Ann")
        notes.put(LEAKAGE.id, "Ben")
        end = time.time()
        assert notes.file is not None
        kept = notes.file.read_bytes()
        assert notes.close() == 1
    with noting(frail, waiting) as (_, seen, _):
        assert seen == {LEAKAGE.id}  # shown at once
        frail.gone = False
    assert not notes.file.exists()
    (by, at) = noted(frail)[LEAKAGE.id]
    assert by == "Ann"
    assert at is not None
    assert begin <= at <= end
    notes.file.write_bytes(kept)  # killed before it was taken away
    with noting(frail, waiting):
        pass
    assert noted(frail)[LEAKAGE.id] == (by, at)
    assert not notes.file.exists()


def test_a_file_of_something_else_is_told(frail: Frail, tmp_path: Path) -> None:
    waiting = tmp_path / "j.waiting.json"
    (tmp_path / "j.acknowledged.json").write_text("[]")
    with pytest.raises(JournalRefused, match="move it away"), noting(frail, waiting):
        pass


def test_an_episode_that_is_not_there_is_told(frail: Frail) -> None:
    with noting(frail, None) as (notes, _, said):
        notes.put("X@0", "Ann")
    assert len(said) == 1
    assert "holds no episode X@0" in said[0]
