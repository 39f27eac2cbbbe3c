"""Tables whose columns are arrays, from files of measurement systems and from data frames; columns
that come in parts."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rulec_runtime.contract.file_form import INFERRED, START, FileForm, Order
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import Convention, columns_of, read_cells
from rulec_runtime.recordings.larger_than_memory import Growing
from rulec_runtime.recordings.table import Cells, Dates, Sheet, Table, texts_of
from rulec_runtime.recordings.time_column import TimeReader


class GrowingCells:
    """Numbers, dates or texts; texts if the kinds are mixed."""

    def __init__(self) -> None:
        self._numbers: Growing | None = None
        self._dates: tuple[Growing, Growing] | None = None
        self._texts: list[str] | None = None
        self._texts_seen: dict[str, str] = {}

    def add(self, cells: Cells) -> None:
        """Append cells."""
        if isinstance(cells, Dates) and self._numbers is None and self._texts is None:
            self._dates = self._dates or (Growing(), Growing())
            self._dates[0].append(cells.seconds)
            self._dates[1].append(cells.zones)
        elif isinstance(cells, np.ndarray) and self._dates is None and self._texts is None:
            self._numbers = self._numbers or Growing()
            self._numbers.append(cells)
        else:
            if self._texts is None:
                self._texts = list(texts_of(self.joined()))
            # Tags and qualities are few and repeat: equal texts share one object.
            seen = self._texts_seen if len(self._texts_seen) < limits.FEW_TEXTS else {}
            self._texts += [seen.setdefault(cell, cell) for cell in texts_of(cells)]
            self._numbers = self._dates = None

    def joined(self) -> Cells:
        """All cells."""
        if self._dates is not None:
            return Dates(self._dates[0].joined(), self._dates[1].joined())
        if self._numbers is not None:
            return self._numbers.joined()
        return np.zeros(0) if self._texts is None else self._texts


class GrowingTimes(GrowingCells):
    """Texts of times, kept as numbers or dates: the first one that is a time shows which.

    Dates are in this `order`; the first text stands for all if none is a time.
    """

    def __init__(self, path: Path, order: Order) -> None:
        super().__init__()
        self._reader = TimeReader(path, FileForm(since=START, dates=order), [])
        self._first: list[str] = []

    def add(self, cells: Cells) -> None:
        """Append texts."""
        self._first = self._first or texts_of(cells)[:1]
        super().add(self._reader.read(cells))

    def joined(self) -> Cells:
        """All times."""
        return self._first if self._reader.dated is None else super().joined()


Pieces = Callable[[Sequence[int]], Iterable[Sequence[Any]]]
"""Gives pieces of the columns with these indexes: per column an array, or `Dates`."""


def array_sheet(
    name: str,
    titles: Sequence[str],
    units: Sequence[str],
    rows: int,
    pieces: Pieces,
    remarks: tuple[str, ...] = (),
) -> Sheet:
    """A table of `rows` rows whose columns are arrays."""

    def read(raw: Sequence[int], numbers: Sequence[int], form: FileForm = INFERRED) -> Table:
        wanted = list(dict.fromkeys([*raw, *numbers]))
        written = [Convention(form.decimal, form.thousands)] * len(numbers)
        columns = columns_of(titles, numbers, written, form)
        aside = [GrowingCells() for _ in raw]
        before = 0
        for piece in pieces(wanted):
            cells = dict(zip(wanted, map(cells_of, piece), strict=True))
            for column, index in zip(columns, numbers, strict=True):
                part = cells[index]
                if isinstance(part, Dates):  # a date is not a number
                    column.parts.append(np.full(len(part), np.nan))
                    column.states += Counter({"a date": int(np.isfinite(part.seconds).sum())})
                    column.first = column.first or (before + 1, "a date")
                elif isinstance(part, np.ndarray):
                    column.parts.append(part)
                else:
                    read_cells(column, list(part), before, comma=True)
            for growing, index in zip(aside, raw, strict=True):
                growing.add(cells[index])
            before += len(cells[wanted[0]]) if wanted else 0
        return Table(raw=tuple(one.joined() for one in aside), columns=columns)

    def lines() -> Iterator[list[str]]:
        for piece in pieces(range(len(titles))):
            columns = [texts_of(cells_of(one)) for one in piece]
            yield from (list(row) for row in zip(*columns, strict=True))

    return Sheet(
        name=name,
        titles=tuple(titles),
        units=tuple(units),
        read=read,
        lines=lines,
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
    return [
        value.decode("utf-8", "replace").rstrip("\0")
        if isinstance(value, bytes)
        else ("" if value is None else str(value))
        for value in values.tolist()
    ]


def seconds_of(values: np.ndarray) -> Array:
    """Seconds of dates (since 1970) or of durations, NaN where missing; rounded to microseconds,
    so that a date gives the same number whatever program wrote it."""
    whole = values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
    return np.where(np.isnat(values), np.nan, (whole + 500) // 1000 / 1e6)
