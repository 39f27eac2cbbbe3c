"""What tests ask of a source."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Notice, Rows, Source
from rulec_runtime.live.sources.growing_file import GrowingFile


class Taken:
    """All that was taken of a source so far."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.rows: list[Rows] = []
        self.notices: list[Notice] = []

    def take(self, seconds: float = 0.0) -> Taken:
        for part in self.source.take(seconds):
            (self.rows if isinstance(part, Rows) else self.notices).append(part)
        return self

    def until(self, met: Callable[[Taken], object], seconds: float = 8.0) -> Taken:
        """Take until it holds; fails after that many seconds."""
        end = time.monotonic() + seconds
        while not met(self):
            assert time.monotonic() < end, (self.told, self.times)
            self.take(0.05)
        return self

    @property
    def times(self) -> list[float]:
        return [float(t) for rows in self.rows for t in rows.time]

    def of(self, signal: str) -> list[float]:
        """All values of a signal; NaN in rows without it."""
        none = [np.full(len(r), np.nan) for r in self.rows]
        parts = [r.values.get(signal, n) for r, n in zip(self.rows, none, strict=True)]
        return [float(v) for v in np.concatenate(parts)] if parts else []

    @property
    def told(self) -> list[tuple[str, str]]:
        return [(n.kind, n.text) for n in self.notices]

    def kinds(self) -> list[str]:
        return [n.kind for n in self.notices]


def lines(times: Sequence[float], header: bool = True) -> str:
    """A table of two signals of plant abc; A.dp in bar is the time over 100."""
    head = "time [s],A.dp [bar],A.n [rpm]\n" if header else ""
    return head + "".join(f"{t:g},{t / 100:g},900\n" for t in times)


def append(path: Path, text: str | bytes) -> None:
    with path.open("ab") as file:
        file.write(text if isinstance(text, bytes) else text.encode())


def growing(folder: Path, abc: Ruleset, text: str) -> tuple[Path, Taken]:
    """A file that begins with a text, and what was taken of it."""
    path = folder / "x.csv"
    path.write_text(text)
    return path, Taken(GrowingFile(path, abc)).take()
