"""Tables whose columns are arrays, from files of measurement systems and from data frames."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rulec_runtime.contract.file_form import AS_SEEN, FileForm
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.csv_table import Column, read_cells
from rulec_runtime.recordings.growing_cells import GrowingCells
from rulec_runtime.recordings.larger_than_memory import Growing
from rulec_runtime.recordings.numbers import Convention
from rulec_runtime.recordings.table import Cells, Dates, Sheet, Table, texts_of

Pieces = Callable[[Sequence[int]], Iterable[Sequence[Any]]]
"""Gives pieces of the columns with these indexes: per column an array, or `Dates`."""


@dataclass(frozen=True)
class ArrayTable:
    """Titles, columns in pieces, and the number of rows."""

    titles: tuple[str, ...]
    pieces: Pieces
    count: int

    def read(self, kept: Sequence[int], numbers: Sequence[int], form: FileForm = AS_SEEN) -> Table:
        wanted = list(dict.fromkeys([*kept, *numbers]))
        place = {index: k for k, index in enumerate(wanted)}
        beside = len(wanted) + len(kept)
        written = Convention(form.decimal, form.thousands)
        columns = tuple(
            Column(self.titles[i].strip(), Growing(self.count, beside), written=written,
                   placed={} if form.words_are_placed else None)
            for i in numbers
        )  # fmt: skip
        parts = [GrowingCells(self.count, beside) for _ in kept]
        rows = 0
        for piece in self.pieces(wanted):
            cells = [cells_of(part) for part in piece]
            for column, index in zip(columns, numbers, strict=True):
                _add(column, cells[place[index]], rows)
            for part, index in zip(parts, kept, strict=True):
                part.add(cells[place[index]])
            rows += len(cells[0]) if cells else 0
        return Table(kept=tuple(part.joined() for part in parts), columns=columns)

    def lines(self) -> Iterator[list[str]]:
        for piece in self.pieces(range(len(self.titles))):
            columns = [texts_of(cells_of(part)) for part in piece]
            yield from (list(row) for row in zip(*columns, strict=True))


def array_sheet(
    name: str,
    titles: Sequence[str],
    units: Sequence[str],
    rows: int,
    pieces: Pieces,
    remarks: tuple[str, ...] = (),
) -> Sheet:
    """A table of `rows` rows whose columns are arrays."""
    table = ArrayTable(tuple(titles), pieces, rows)
    return Sheet(
        name=name,
        titles=table.titles,
        units=tuple(units),
        read=table.read,
        lines=table.lines,
        rows=rows,
        remarks=remarks,
    )


def cells_of(part: Any) -> Cells:
    """A column as numbers, dates without a zone, or text."""
    if isinstance(part, Dates):
        return part
    values = np.ma.filled(part, np.nan) if isinstance(part, np.ma.MaskedArray) else np.asarray(part)
    values = values.reshape(-1)
    kind = values.dtype.kind
    if kind == "M":
        return Dates(seconds_of(values), np.full(len(values), np.nan))
    if kind == "m":
        return seconds_of(values)
    if kind in "biuf":
        return values.astype(float)
    return [_text(value) for value in values.tolist()]


def seconds_of(values: np.ndarray) -> Array:
    """Seconds of dates (since 1970) or of durations, NaN where missing; rounded to microseconds,
    so that a date gives the same number whatever program wrote it."""
    whole = values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
    return np.where(np.isnat(values), np.nan, (whole + 500) // 1000 / 1e6)


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace").rstrip("\0")
    return "" if value is None else str(value)


def _add(column: Column, cells: Cells, before: int) -> None:
    """Append cells to a column of numbers; a date is not a number."""
    if isinstance(cells, np.ndarray):
        column.parts.append(cells)
    elif isinstance(cells, Dates):
        column.parts.append(np.full(len(cells), np.nan))
        column.states += Counter({"a date": int(np.isfinite(cells.seconds).sum())})
        column.first = column.first or (before + 1, "a date")
    else:
        read_cells(column, list(cells), before, comma=True)
