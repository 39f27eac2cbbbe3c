"""Pieces of work, and the choice of an engine."""

from dataclasses import dataclass
from typing import Any

LOCAL, DASK = "local", "dask"
ENGINES = (LOCAL, DASK)


@dataclass(frozen=True)
class Call:
    """A piece of work: its own arguments, followed by the one that calls share under a name."""

    words: tuple[Any, ...]
    shared: str | None = None


@dataclass(frozen=True, kw_only=True)
class Engine:
    """The kind of engine, its number of processes, and the scheduler of an existing cluster."""

    kind: str = LOCAL
    jobs: int = 1
    scheduler: str | None = None
