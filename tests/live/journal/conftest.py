"""Databases of our own: a file, and a schema in a PostgreSQL server."""

from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import pytest
import sqlalchemy as sa

from tests.live.journal.postgres import Postgres


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
