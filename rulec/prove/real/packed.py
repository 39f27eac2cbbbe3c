"""Text files that may be packed (`.gz`); the same text gives the same bytes."""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO


@contextmanager
def opened(file: Path) -> Iterator[IO[str]]:
    """A text, packed or not."""
    if file.suffix == ".gz":
        with gzip.open(file, "rt", encoding="utf-8", newline="") as packed:
            yield packed
    else:
        with file.open(encoding="utf-8", newline="") as plain:
            yield plain


def write_packed(file: Path, text: str) -> None:
    """Write a text, packed where the name says so."""
    data = text.encode()
    file.write_bytes(gzip.compress(data, mtime=0) if file.suffix == ".gz" else data)
