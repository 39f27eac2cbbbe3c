"""What tests ask of a source, and bytes mutated for it."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Notice, Rows, Source
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.growing_file import GrowingFile
from rulec_runtime.output.terminal import is_shown


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
            assert time.monotonic() < end, (self.reports, self.times)
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
    def reports(self) -> list[tuple[str, str]]:
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


PIECES = [
    *(b"\x1b[2J", b"\x1b]0;x\x07", b"\0", b"\xff\xfe", b"\xe2\x80\xae", b"\xed\xa0\x80"),
    *(b"\r", b"\n", b'"', b"'", b"{", b"}", b"]", b"[" * 2000, b",", b";", b"#", b"sep=,"),
    *(b"NaN", b"Infinity", b"1e999", b"-1e308", b"9" * 5000, b"0x10", b"1_0", b"null", b"true"),
    *(b'{"value":', b'"metrics":[', b"[/red]", b"$(id)", b"\\u0000", b"\\u001b[2J", b"=1+1"),
]


def mutated(text: bytes, draw: random.Random) -> bytes:
    """Bytes changed, cut, doubled, and pieces of other things put in."""
    data = bytearray(text)
    for _ in range(draw.randrange(1, 5)):
        at = draw.randrange(len(data) + 1)
        match draw.randrange(5):
            case 0:
                data[at:at] = draw.choice(PIECES)
            case 1:
                del data[at : at + draw.randrange(1, 20)]
            case 2 if at < len(data):
                data[at] = draw.randrange(256)
            case 3:
                data[at:at] = data[: draw.randrange(40)]
            case _:
                data[at : at + draw.randrange(8)] = draw.choice(PIECES)
    return bytes(data)


def check(parts: list[Rows | Notice]) -> tuple[int, int]:
    """How many rows and notices; nothing in a notice steers a terminal, rows are numbers."""
    rows = [p for p in parts if isinstance(p, Rows)]
    notices = [p for p in parts if isinstance(p, Notice)]
    for one in notices:
        assert all(is_shown(c) for c in one.text), one
        assert len(one.text) <= limits.LONGEST_NOTICE + 3
    for block in rows:
        assert np.isfinite(block.time).all()
        assert (np.diff(block.time) > 0).all()
        assert not any(np.isinf(v).any() for v in block.values.values())
    return sum(map(len, rows)), len(notices)
