"""Where a value comes from."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Origin:
    """Where a derived value comes from: file, line and citation."""

    file: str
    line: int
    source: str = ""
