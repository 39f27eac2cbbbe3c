"""The tables of a journal, the same in SQLite and PostgreSQL."""

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.event_records import NUMBERS, TEXTS
from rulec_runtime.live.journal.refused import JournalRefused

METADATA = sa.MetaData()

EVENTS = sa.Table(
    "events",
    METADATA,
    sa.Column("plant", sa.Text, primary_key=True),
    sa.Column("number", sa.BigInteger, primary_key=True, autoincrement=False),
    sa.Column("time", sa.Double, nullable=False),
    sa.Column("iso", sa.Text),
    sa.Column("active", sa.Boolean, nullable=False),
    sa.Column("alternatives", sa.JSON, nullable=False),
    *(sa.Column(n, sa.Text, nullable=False) for n in ("what", "text", "episode", "told", *TEXTS)),
    *(sa.Column(name, sa.Double) for name in NUMBERS),
    sa.Index("events_of_an_episode", "plant", "episode", "number"),
    sa.Index("events_in_time", "time"),
)

STATES = sa.Table(
    "states",
    METADATA,
    sa.Column("plant", sa.Text, primary_key=True),
    sa.Column("number", sa.BigInteger, nullable=False),
    sa.Column("state", sa.LargeBinary, nullable=False),
    sa.Column("saved", sa.Double, nullable=False),
)

ACKNOWLEDGED = sa.Table(
    "acknowledged",
    METADATA,
    sa.Column("plant", sa.Text, primary_key=True),
    sa.Column("episode", sa.Text, primary_key=True),
    sa.Column("by", sa.Text, nullable=False),
    sa.Column("at", sa.Double, nullable=False),
)

WATCHERS = sa.Table(
    "watchers",
    METADATA,
    sa.Column("plant", sa.Text, primary_key=True),
    sa.Column("token", sa.Text, nullable=False),
    sa.Column("machine", sa.Text, nullable=False),
    sa.Column("process", sa.Text, nullable=False),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("expires", sa.Double, nullable=False),
)

_VERSION = sa.Table("rulec_journal", METADATA, sa.Column("version", sa.Integer, primary_key=True))


def checked(connection: sa.Connection, address: str, make: bool) -> None:
    """Check that the tables exist in this version; creates them in an empty database if `make`.

    Raises `JournalRefused` for a foreign database, or another version.
    """
    if connection.dialect.name == "postgresql":
        # If two processes come first at once, the second waits and finds the tables.
        connection.execute(sa.text("SELECT pg_advisory_xact_lock(hashtext('rulec_journal'))"))
    there = set(sa.inspect(connection).get_table_names())
    if _VERSION.name not in there:
        if there:
            names = ", ".join(sorted(there)[:3])
            raise JournalRefused(
                f"{address} is no journal: it holds tables of something else "
                f"({names}); name another one"
            )
        if not make:
            raise JournalRefused(f"{address} is empty, it holds no journal")
        METADATA.create_all(connection)
        connection.execute(_VERSION.insert().values(version=limits.SCHEMA))
        return
    versions = list(connection.execute(sa.select(_VERSION.c.version)).scalars())
    if versions != [limits.SCHEMA]:
        found = ", ".join(map(str, versions)) or "none"
        raise JournalRefused(
            f"{address} is a journal of version {found}, this rulec reads {limits.SCHEMA}: use the "
            "rulec that wrote it, or another journal"
        )
    if gone := {table.name for table in METADATA.sorted_tables} - there:
        raise JournalRefused(f"{address} is a damaged journal: no table {', '.join(sorted(gone))}")


def clock(connection: sa.Connection) -> float:
    """Seconds since 1970 by the clock of the database, which all its users share."""
    query = "SELECT (julianday('now') - 2440587.5) * 86400.0"
    if connection.dialect.name == "postgresql":
        query = "SELECT extract(epoch FROM clock_timestamp())"
    return float(connection.execute(sa.text(query)).scalar_one())


def insert(connection: sa.Connection, table: sa.Table) -> sqlite.Insert | postgresql.Insert:
    """An insert that supports `on_conflict`."""
    if connection.dialect.name == "postgresql":
        return postgresql.insert(table)
    return sqlite.insert(table)
