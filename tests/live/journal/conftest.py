"""Databases of our own: a file, and a schema in a PostgreSQL server."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import pytest
import sqlalchemy as sa

PROGRAMS = sorted(Path("/usr/lib/postgresql").glob("*/bin"))


class Postgres:
    """It listens at a socket in its folder alone."""

    def __init__(self) -> None:
        if not PROGRAMS:
            pytest.skip("no server of PostgreSQL in /usr/lib/postgresql")
        self._programs = PROGRAMS[-1]
        self.folder = Path(tempfile.mkdtemp(prefix="rulec-pg-", dir="/tmp"))
        # The server refuses to be run by root.
        self._user = "nobody" if os.geteuid() == 0 else None
        if self._user:
            shutil.chown(self.folder, self._user)
        self.url = f"postgresql+psycopg://rulec@/postgres?host={self.folder}"
        data = str(self.folder / "data")
        self._run("initdb", "-D", data, "-U", "rulec", "-A", "trust", "--no-sync", "-E", "UTF8")
        self.start()

    def start(self) -> None:
        # Processes are killed here, never the computer: nothing need reach the disk, and a server
        # that starts again after that does not bring all of its files there first.
        options = f"-c listen_addresses='' -k {self.folder} -c shared_buffers=8MB -c fsync=off"
        self._pg_ctl("start", "-l", str(self.folder / "log"), "-o", options)

    @contextmanager
    def gone(self) -> Iterator[None]:
        """As when somebody restarts it: who is connected is thrown out."""
        self._pg_ctl("stop", "-m", "immediate")
        try:
            yield
        finally:
            self.start()

    def close(self) -> None:
        self._pg_ctl("stop", "-m", "immediate", check=False)
        shutil.rmtree(self.folder, ignore_errors=True)

    def _pg_ctl(self, *arguments: str, check: bool = True) -> None:
        self._run("pg_ctl", "-w", "-D", str(self.folder / "data"), *arguments, check=check)

    def _run(self, program: str, *arguments: str, check: bool = True) -> None:
        done = subprocess.run(
            [str(self._programs / program), *arguments],
            user=self._user,
            cwd="/",
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
        )
        assert not check or done.returncode == 0, (program, arguments)


@pytest.fixture(scope="session")
def server() -> Iterator[Postgres]:
    made = Postgres()
    yield made
    made.close()


@pytest.fixture
def schema(server: Postgres) -> str:
    """The address of a schema, as where several plants share a database with others."""
    name, engine = f"s{uuid4().hex}", sa.create_engine(server.url)
    with engine.begin() as connection:
        connection.exec_driver_sql(f"CREATE SCHEMA {name}")
    engine.dispose()
    return f"{server.url}&options=-csearch_path%3D{name}"


@pytest.fixture(params=["file", "postgres"])
def where(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Where a journal is kept, in each of the databases."""
    if request.param == "file":
        return str(tmp_path / "j.db")
    return str(request.getfixturevalue("schema"))
