"""Recordings as tables of text that tests bend: the shipped examples, one thing changed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.recording import Recording

from tests.conftest import ROOT


@dataclass(frozen=True)
class Sheet:
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def index(self, column: str) -> int:
        """Place of a column by its name without unit."""
        return next(i for i, title in enumerate(self.header) if title.split(" [")[0] == column)

    def renamed(self, column: str, title: str) -> Sheet:
        i = self.index(column)
        return replace(self, header=(*self.header[:i], title, *self.header[i + 1 :]))

    def mapped(self, column: str, change: Callable[[int, str], str]) -> Sheet:
        i = self.index(column)
        rows = [(*r[:i], change(k, r[i]), *r[i + 1 :]) for k, r in enumerate(self.rows)]
        return replace(self, rows=tuple(rows))

    def filled(self, column: str, value: str, since: int = 0, until: int | None = None) -> Sheet:
        stop = len(self.rows) if until is None else until
        return self.mapped(column, lambda k, cell: value if since <= k < stop else cell)

    def scaled(self, column: str, factor: float, title: str) -> Sheet:
        return self.mapped(column, lambda _, c: repr(float(c) * factor)).renamed(column, title)

    def without(self, *columns: str) -> Sheet:
        gone = {self.index(c) for c in columns}
        keep = [i for i in range(len(self.header)) if i not in gone]
        return Sheet(
            tuple(self.header[i] for i in keep),
            tuple(tuple(row[i] for i in keep) for row in self.rows),
        )

    def text(self, separator: str = ",", newline: str = "\n") -> str:
        return "".join(separator.join(row) + newline for row in (self.header, *self.rows))

    def german(self) -> str:
        """As a file of a German spreadsheet: semicolon and decimal comma."""
        rows = tuple(tuple(cell.replace(".", ",") for cell in row) for row in self.rows)
        return replace(self, rows=rows).text(";")


def example(name: str = "healthy") -> Sheet:
    """A shipped recording of the plant abc."""
    text = (ROOT / "plants" / "abc" / "examples" / f"{name}.csv").read_text(encoding="utf-8")
    header, *rows = (tuple(line.split(",")) for line in text.splitlines())
    return Sheet(header, tuple(rows))


def write(folder: Path, content: str | bytes, name: str = "x.csv") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def sampled(
    values: Mapping[str, Array], time: Array | None = None, missing: tuple[str, ...] = ()
) -> Recording:
    """A recording in one piece, SI; one sample per second unless there are times."""
    n = len(next(iter(values.values())))
    return Recording(
        time=np.arange(n, dtype=float) if time is None else time,
        values=dict(values),
        segment=np.zeros(n, dtype=int),
        missing=missing,
        notes=(),
    )
