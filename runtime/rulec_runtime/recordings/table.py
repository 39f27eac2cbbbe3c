"""What every reader returns: the tables of a file, each read on demand."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from typing import Protocol

import numpy as np

from rulec_runtime.contract.file_form import FileForm
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.csv_table import Column


@dataclass(frozen=True)
class Dates:
    """Dates, shape (n,): `seconds` since 1970, NaN where missing; `zones` are seconds ahead of UTC,
    NaN where a date names no zone and counts as UTC."""

    seconds: Array
    zones: Array

    def __len__(self) -> int:
        return len(self.seconds)


Cells = Sequence[str] | Array | Dates
"""A column in the form of the file: text, numbers or dates."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """The wanted columns of a table.

    Attributes
    ----------
    raw : columns in the form of the file (times), in the order asked for.
    columns : the others, as numbers.
    left_out : number of rows with a wrong number of cells; the first is `first_left_out`.
    remarks : on oddities found while reading.
    """

    raw: tuple[Cells, ...]
    columns: tuple[Column, ...]
    left_out: int = 0
    first_left_out: int = 0
    remarks: tuple[str, ...] = ()


class Read(Protocol):
    """Reads columns by their indexes, some as they are and some as numbers, as far as known in a
    form."""

    def __call__(
        self, raw: Sequence[int], numbers: Sequence[int], form: FileForm = ..., /
    ) -> Table: ...


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """A table of a file, not read yet.

    Attributes
    ----------
    name : of the table within its file; empty if the file is one table.
    titles : of its columns.
    units : beside the titles in the file, empty if missing; as many as titles.
    rows : their number, if known before reading.
    read : reads columns.
    lines : all rows that `read` keeps, as text.
    separator : of its cells; a comma if it is no text.
    """

    name: str
    titles: tuple[str, ...]
    units: tuple[str, ...]
    read: Read
    lines: Callable[[], Iterator[list[str]]]
    rows: int | None = None
    separator: str = ","
    remarks: tuple[str, ...] = ()


def lines_of(read: Read, count: int) -> Iterator[list[str]]:
    """All rows of a table of `count` columns as text."""
    columns = (texts_of(cells) for cells in read(range(count), ()).raw)
    return (list(row) for row in zip(*columns, strict=True))


def texts_of(cells: Cells) -> list[str]:
    """Cells as in a CSV file; numbers keep every digit."""
    if isinstance(cells, Dates):
        texts, epoch = list[str](), datetime.fromtimestamp(0, UTC)
        for seconds, zone in zip(cells.seconds.tolist(), cells.zones.tolist(), strict=True):
            if np.isnan(seconds):
                texts.append("")
                continue
            date = epoch + timedelta(seconds=seconds)
            if np.isnan(zone):
                texts.append(date.replace(tzinfo=None).isoformat())
            else:
                texts.append(date.astimezone(timezone(timedelta(seconds=zone))).isoformat())
        return texts
    if isinstance(cells, np.ndarray):
        return ["" if np.isnan(x) else repr(x).removesuffix(".0") for x in cells.tolist()]
    return list(cells)
