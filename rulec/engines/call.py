"""Pieces of work, and which engine does them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

LOCAL, DASK = "local", "dask"
ENGINES = (LOCAL, DASK)


@dataclass(frozen=True)
class Call:
    """A piece of work: own arguments, and the name of one that many calls share, if any.

    What is shared is handed over behind the own arguments.
    """

    words: tuple[Any, ...]
    shared: str | None = None


@dataclass(frozen=True, kw_only=True)
class Engine:
    """Which engine, with how many processes; the scheduler of a cluster that is there."""

    kind: str = LOCAL
    jobs: int = 1
    scheduler: str | None = None
