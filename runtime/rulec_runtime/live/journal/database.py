"""Connections to the database of a journal, and its errors."""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy import exc

from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.output.open_file import begin_of
from rulec_runtime.output.refusal import to_install

READING = {"rulec_reading": True}
"""Execution options of a transaction that only reads."""

_SERVERS = ("postgresql", "postgresql+psycopg", "postgres")
_MAGIC = b"SQLite format 3\0"


def engine_of(where: str, make: bool) -> tuple[sa.Engine, str]:
    """The engine for a path or URL, and its name for people, without the password.

    Raises `JournalRefused` for an unusable path or URL.
    """
    if "://" not in where:
        return _file(Path(where), make), where
    try:
        url = sa.make_url(where)
    except (exc.ArgumentError, ValueError):
        # The text is not shown, as it may contain a password.
        raise JournalRefused(
            "this URL of a journal cannot be read; for example "
            "postgresql+psycopg://name@host/database"
        ) from None
    if url.drivername in _SERVERS:
        return _server(url.set(drivername="postgresql+psycopg"))
    raise JournalRefused(
        f"a journal is a file or postgresql+psycopg://..., not {url.drivername}://"
    )


def _file(path: Path, make: bool) -> sa.Engine:
    """SQLite in WAL mode; each transaction is synced to the disk."""
    try:
        if begin_of(path, len(_MAGIC)) not in (_MAGIC, b""):
            raise JournalRefused(f"{path} is no journal, nor any database of SQLite")
    except (FileNotFoundError, NotADirectoryError):
        if not make:
            raise JournalRefused(
                f"{path}: there is no journal; rulec watch --journal FILE writes one"
            ) from None
        if not path.parent.is_dir():
            raise JournalRefused(
                f"{path}: there is no folder '{path.parent}'; make it first"
            ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise JournalRefused(f"{path}: {reason}") from None

    def connect() -> sqlite3.Connection:
        mode = "rwc" if make else "rw"
        if not _writable(path) and not path.with_name(f"{path.name}-wal").exists():
            mode = "ro&immutable=1"  # WAL mode writes beside the file even to read it
        uri = f"{path.absolute().as_uri()}?mode={mode}"
        return sqlite3.connect(
            uri, uri=True, timeout=limits.BUSY, isolation_level=None, check_same_thread=False
        )

    engine = sa.create_engine("sqlite://", creator=connect, poolclass=sa.QueuePool, pool_size=2)

    @sa.event.listens_for(engine, "connect")
    def _prepare(connection: Any, record: Any) -> None:
        connection.execute("PRAGMA synchronous=FULL")
        record.info["file"] = _identity(path)

    @sa.event.listens_for(engine, "checkout")
    def _still_there(_: Any, record: Any, __: Any) -> None:
        # Writes to a file that was moved or deleted are lost; a connection opened on a read-only
        # disk stays read-only.
        if record.info["file"] != _identity(path):
            raise exc.DisconnectionError

    @sa.event.listens_for(engine, "begin")
    def _begin(connection: sa.Connection) -> None:
        # A writer takes the lock first, so that nobody can write between its read and its write.
        reading = connection.get_execution_options().get("rulec_reading")
        connection.exec_driver_sql("BEGIN" if reading else "BEGIN IMMEDIATE")

    return engine


def prepared(engine: sa.Engine, address: str) -> None:
    """Switch a file that is a journal to WAL mode, in which readers never wait."""
    if engine.dialect.name == "sqlite":
        with translated(address), engine.connect() as connection:
            driver: Any = connection.connection
            driver.execute("PRAGMA journal_mode=WAL").fetchall()


def _identity(path: Path) -> tuple[int, int, bool] | None:
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_dev, found.st_ino, _writable(path)


def _writable(path: Path) -> bool:
    return os.access(path.parent, os.W_OK)


def _server(url: sa.URL) -> tuple[sa.Engine, str]:
    """PostgreSQL; a silent connection is given up."""
    patience = {
        "connect_timeout": int(limits.CONNECT),
        "keepalives_idle": limits.SILENT // 2,
        "keepalives_interval": 2,
        "keepalives_count": 3,
        "tcp_user_timeout": limits.SILENT * 1000,
    }
    try:
        engine = sa.create_engine(
            url,
            connect_args={k: v for k, v in patience.items() if k not in url.query},
            pool_pre_ping=True,
            pool_size=2,
        )
    except ImportError:
        raise JournalRefused(
            f"a journal in PostgreSQL needs the package 'psycopg': {to_install('postgres')}"
        ) from None

    @sa.event.listens_for(engine, "connect")
    def _prepare(connection: Any, _: object) -> None:
        with connection.cursor() as cursor:
            cursor.execute(f"SET statement_timeout = '{limits.STATEMENT}s'")
            cursor.execute(f"SET lock_timeout = '{limits.BUSY:g}s'")
            # A committed transaction must be on the disk; a stricter setting stays.
            cursor.execute(
                "SELECT set_config('synchronous_commit', 'on', false)"
                " WHERE current_setting('synchronous_commit') IN ('off', 'local')"
            )
        connection.commit()

    return engine, url.render_as_string(hide_password=True)


@contextmanager
def translated(address: str) -> Iterator[None]:
    """Translate database errors: `JournalTrouble` may pass, `JournalRefused` is permanent."""
    try:
        yield
    except exc.DBAPIError as error:
        # Only the first line: statements and their values follow.
        reason = next(iter(str(error.orig).strip().splitlines()), type(error.orig).__name__)
        lasting = (exc.IntegrityError, exc.ProgrammingError, exc.DataError, exc.NotSupportedError)
        plain = type(error) is exc.DatabaseError  # SQLite: not a database, or a damaged one
        if plain or isinstance(error, lasting):
            raise JournalRefused(f"{address}: {reason}") from None
        raise JournalTrouble(f"{address}: {reason}") from None
    except exc.TimeoutError:
        raise JournalTrouble(f"{address}: no connection is free") from None
    except (exc.SQLAlchemyError, sqlite3.Error) as error:
        raise JournalTrouble(f"{address}: {type(error).__name__}") from None
