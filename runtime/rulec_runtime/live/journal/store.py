"""The journal: events and the state of the watcher in one database, written in one transaction.

SQLite in its own file, or PostgreSQL if plants share a server.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path

import sqlalchemy as sa

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.database import READING, engine_of, prepared, translated
from rulec_runtime.live.journal.event_records import (
    Entry,
    Record,
    event_of,
    keepable,
    name_of,
    other_content,
    record_of,
)
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.journal.tables import ACKNOWLEDGED, EVENTS, STATES, checked, clock, insert
from rulec_runtime.live.journal.watcher import Watcher


@dataclass(frozen=True)
class Saved:
    """The state of the watcher after event `number`, and when it was saved, s since 1970."""

    number: int
    state: bytes
    at: float


def open_journal(where: str, *, make: bool = True, patient: bool = False) -> Journal:
    """Open a journal at a path or ``postgresql+psycopg://...``.

    A missing journal is created, unless `make` is False. Raises `JournalRefused` if something else
    is there, and `JournalTrouble` if the database does not answer now, unless `patient`: then the
    check follows when it answers.
    """
    engine, address = engine_of(where, make)
    journal = Journal(engine, address, make)
    try:
        with suppress(JournalTrouble) if patient else nullcontext():
            journal.check()
    except BaseException:
        journal.close()
        raise
    return journal


class Journal:
    """An open journal, for several threads.

    All methods raise `JournalTrouble` if the database is gone or full, and then change nothing.
    """

    def __init__(self, engine: sa.Engine, address: str, make: bool) -> None:
        self._engine, self._make = engine, make
        self._checked = False
        self._me = Watcher()
        self.address = address
        """Path or URL without the password, for people."""

    def check(self) -> None:
        """Raises `JournalRefused` if the database is not a journal of ours."""
        with self._begun(reading=not self._make) as connection:
            checked(connection, self.address, self._make)
        if self._make:
            prepared(self._engine, self.address)
        self._checked = True

    @contextmanager
    def transaction(self, reading: bool = False) -> Iterator[sa.Connection]:
        """A connection whose changes are committed at the end, all or none."""
        if not self._checked:
            self.check()
        with self._begun(reading) as connection:
            yield connection

    @contextmanager
    def _begun(self, reading: bool) -> Iterator[sa.Connection]:
        with translated(self.address), self._engine.connect() as plain:
            connection = plain.execution_options(**READING) if reading else plain
            with connection.begin():
                yield connection

    @property
    def is_there(self) -> bool:
        """Whether it may contain something, which a missing file does not."""
        return "://" in self.address or Path(self.address).exists()

    def take_lease(self, plant: str) -> None:
        """Take the lease of a plant, or renew it; no other watcher can until `release`, or the end
        of this process. Raises `JournalRefused` while another one holds it."""
        with self.transaction() as connection:
            self._me.take_lease(connection, plant, self.address)

    def release(self, plant: str) -> None:
        """Give up the lease of a plant."""
        with self.transaction() as connection:
            self._me.left(connection, plant)

    def commit(
        self, plant: str, events: Sequence[Event], state: bytes | None, *, dated: bool = True
    ) -> None:
        """Store events, and the state of the watcher after the last: all or nothing.

        Repeated events are ignored, and an older state does not replace a newer one. `dated` if
        times are s since 1970 in UTC. Raises `JournalRefused` for another event with a number that
        is taken, and while another process watches the plant.
        """
        with self.transaction() as connection:
            self._me.take_lease(connection, plant, self.address)
            self._keep(connection, plant, [record_of(event, dated) for event in events])
            if state is not None:
                number = max((e.number for e in events), default=_last(connection, plant))
                row = {"number": number, "state": state, "saved": clock(connection)}
                statement = insert(connection, STATES).values(plant=plant, **row)
                newer = STATES.c.number <= number
                connection.execute(
                    statement.on_conflict_do_update(index_elements=["plant"], set_=row, where=newer)
                )

    def _keep(self, connection: sa.Connection, plant: str, records: list[Record]) -> None:
        new: dict[int, Record] = {}
        for record in records:
            before = new.setdefault(record["number"], record)
            if before != record:
                raise other_content(self.address, plant, record["number"], before, record)
        if not new:
            return
        between = EVENTS.c.number.between(min(new), max(new))
        for row in connection.execute(sa.select(EVENTS).where(EVENTS.c.plant == plant, between)):
            stored = dict(row._mapping)
            del stored["plant"]
            record = new.pop(stored["number"], stored)
            if stored != record:
                raise other_content(self.address, plant, stored["number"], stored, record)
        if new:
            rows = [{"plant": plant, **record} for _, record in sorted(new.items())]
            connection.execute(EVENTS.insert(), rows)

    def state(self, plant: str) -> Saved | None:
        """The last saved state, or None."""
        with self.transaction(reading=True) as connection:
            row = connection.execute(sa.select(STATES).where(STATES.c.plant == plant)).one_or_none()
        return None if row is None else Saved(row.number, bytes(row.state), row.saved)

    def last(self, plant: str) -> int:
        """Number of the last event; 0 without one. It may be larger than that of the state, if the
        event was stored without a state."""
        with self.transaction(reading=True) as connection:
            return _last(connection, plant)

    def plants(self) -> tuple[str, ...]:
        """Plants with events."""
        with self.transaction(reading=True) as connection:
            query = sa.select(EVENTS.c.plant).distinct().order_by(EVENTS.c.plant)
            return tuple(connection.execute(query).scalars())

    def events(
        self,
        plant: str | None = None,
        *,
        since: float | None = None,
        until: float | None = None,
        kind: Sequence[str] = (),
        status: Sequence[str] = (),
        active: bool = False,
        limit: int | None = None,
    ) -> Iterator[Entry]:
        """Events in order of time, read lazily.

        `since` and `until` bound the time of events, s; `active` selects the last event of each
        episode that has not ended; `limit` selects the latest ones.
        """
        query = sa.select(EVENTS, ACKNOWLEDGED.c.by, ACKNOWLEDGED.c.at).outerjoin(
            ACKNOWLEDGED,
            (ACKNOWLEDGED.c.plant == EVENTS.c.plant) & (ACKNOWLEDGED.c.episode == EVENTS.c.episode),
        )
        if active:
            later = EVENTS.alias()
            beyond = (later.c.plant == EVENTS.c.plant) & (later.c.episode == EVENTS.c.episode)
            newer = sa.exists().where(beyond & (later.c.number > EVENTS.c.number))
            query = query.where(EVENTS.c.active, ~newer)
        query = query if plant is None else query.where(EVENTS.c.plant == plant)
        for column, values in (("kind", kind), ("status", status)):
            query = query.where(EVENTS.c[column].in_(values)) if values else query
        query = query if since is None else query.where(EVENTS.c.time >= since)
        query = query if until is None else query.where(EVENTS.c.time <= until)
        order = (EVENTS.c.time, EVENTS.c.plant, EVENTS.c.number)
        if limit is not None:
            part = query.order_by(*(column.desc() for column in order)).limit(limit).subquery()
            query = sa.select(part).order_by(part.c.time, part.c.plant, part.c.number)
        else:
            query = query.order_by(*order)
        with self.transaction(reading=True) as connection:
            result = connection.execute(query.execution_options(yield_per=limits.BATCH))
            for row in result:
                data = dict(row._mapping)
                yield Entry(data["plant"], event_of(data), data["iso"], data["by"], data["at"])

    def holds(self, plant: str, episode: str) -> bool:
        """Whether there is an event of an episode."""
        there = (EVENTS.c.plant == plant) & (EVENTS.c.episode == keepable(episode))
        with self.transaction(reading=True) as connection:
            return connection.execute(sa.select(EVENTS.c.number).where(there)).first() is not None

    def acknowledge(self, plant: str, episode: str, by: str, at: float | None = None) -> bool:
        """Acknowledge an episode; returns False, and changes nothing, if somebody had before.

        `at` is the time, s since 1970; None for now. Raises `JournalRefused` if there is no such
        episode.
        """
        who = name_of(by).strip()
        if not who:
            raise JournalRefused("whoever acknowledges needs a name")
        if not self.holds(plant, episode):
            raise JournalRefused(f"{self.address} holds no episode {episode} of {plant}")
        with self.transaction() as connection:
            when = clock(connection) if at is None else at
            row = {"plant": plant, "episode": keepable(episode), "by": who, "at": when}
            statement = insert(connection, ACKNOWLEDGED).values(row).on_conflict_do_nothing()
            new = connection.execute(statement.returning(ACKNOWLEDGED.c.at))
            return new.first() is not None

    def acknowledged(self, plant: str) -> frozenset[str]:
        """Ids of acknowledged episodes."""
        with self.transaction(reading=True) as connection:
            query = sa.select(ACKNOWLEDGED.c.episode).where(ACKNOWLEDGED.c.plant == plant)
            return frozenset(connection.execute(query).scalars())

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()


def _last(connection: sa.Connection, plant: str) -> int:
    query = sa.select(sa.func.max(EVENTS.c.number)).where(EVENTS.c.plant == plant)
    return int(connection.execute(query).scalar() or 0)
