"""The same journal in a real PostgreSQL."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import sqlalchemy as sa
from rulec_runtime.live.journal.outbox import Outbox
from rulec_runtime.live.journal.refused import JournalRefused
from rulec_runtime.live.journal.store import open_journal

from tests.live.journal.events import LEAKAGE, event, kept_in, story
from tests.live.journal.postgres import Postgres
from tests.live.journal.test_killed import check_journal


@pytest.fixture(scope="module")
def server() -> Iterator[Postgres]:
    made = Postgres()
    yield made
    made.close()


@pytest.fixture
def url(server: Postgres, request: pytest.FixtureRequest) -> str:
    """A schema of its own in the database, as where several plants share one with others."""
    schema = request.node.name.removeprefix("test_")
    engine = sa.create_engine(server.url)
    with engine.begin() as connection:
        connection.exec_driver_sql(f"CREATE SCHEMA {schema}")
    engine.dispose()
    return f"{server.url}&options=-csearch_path%3D{schema}"


def test_same_as_in_a_file(url: str) -> None:
    journal = open_journal(url)
    for _ in range(2):
        journal.commit("abc", story(), b"\0state")
    assert [entry.event for entry in journal.events("abc")] == story()
    assert [entry.event.number for entry in journal.events(active=True)] == [3]
    assert [entry.event.number for entry in journal.events(status=["C"], limit=1)] == [4]
    assert kept_in(journal) == (4, b"\0state")
    assert journal.acknowledge("abc", LEAKAGE.id, "Ann")
    assert journal.acknowledged("abc") == {LEAKAGE.id}
    with pytest.raises(JournalRefused, match="another event 4 of abc"):
        journal.commit("abc", [event(4)], None)
    other = open_journal(url)
    with pytest.raises(JournalRefused, match="abc is watched already"):
        other.hold("abc")
    for one in (journal, other):
        one.close()


def test_tables_of_something_else(url: str) -> None:
    engine = sa.create_engine(url)
    with engine.begin() as connection:
        connection.exec_driver_sql("CREATE TABLE customers (name text)")
    engine.dispose()
    with pytest.raises(JournalRefused, match=r"something else \(customers\)"):
        open_journal(url)


def test_killed(url: str) -> None:
    check_journal(url, 5)


def test_stopped_and_started_again(server: Postgres, url: str, tmp_path: Path) -> None:
    """Also while the watcher starts: it goes on, and writes when the server is there."""
    server.stop()
    said: list[str] = []
    journal = open_journal(url, patient=True)
    outbox = Outbox(journal, "abc", said.append, file=tmp_path / "waiting.json")
    outbox.start()
    outbox.put(story()[:2], b"2")
    _until(lambda: len(said) == 1)
    server.start()
    _until(lambda: outbox.pending == 0)
    server.stop()
    outbox.put(story()[2:], b"4")
    _until(lambda: len(said) == 3)
    server.start()
    assert outbox.close() == 0
    assert [entry.event for entry in journal.events("abc")] == story()
    assert len(said) == 4
    journal.close()


def _until(true: Callable[[], bool]) -> None:
    ends = time.monotonic() + 20
    while not true():
        assert time.monotonic() < ends
        time.sleep(0.02)
