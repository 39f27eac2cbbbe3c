"""A table whose rows are text, from CSV files and spreadsheets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from rulec_runtime.recordings.csv_table import (
    Column,
    RecordingRefused,
    is_whole,
    read_cells,
    refuse_words,
)
from rulec_runtime.recordings.growing_cells import GrowingCells, GrowingTimes
from rulec_runtime.recordings.scratch import Growing
from rulec_runtime.recordings.table import Sheet, Table
from rulec_runtime.recordings.titles import is_time, units_below

BATCH = 1000
"""Rows read at a time: cells become numbers before the next rows are read, while they are still in
the cache."""


@dataclass(frozen=True)
class TextTable:
    """Titles of a table, and how its rows are read, from those below the titles on."""

    path: Path
    titles: tuple[str, ...]
    rows: Callable[[], Iterator[list[str]]]
    separator: str
    has_units: bool
    most: int | None = None
    times: frozenset[str] = frozenset()

    def read(self, kept: Sequence[int], numbers: Sequence[int]) -> Table:
        """Rows with another number of cells than the titles are left out, as no cell of them can
        be trusted. Raises `RecordingRefused`."""
        beside = len(numbers) + 3 * len(kept)
        columns = tuple(Column(self.titles[i].strip(), Growing(self.most, beside)) for i in numbers)
        texts = [self._growing(index, beside) for index in kept]
        rows, width = self._below(), len(self.titles)
        count = whole_before = left_out = first_left_out = 0
        while batch := list(islice(rows, BATCH)):
            whole = batch
            if {*map(len, batch)} != {width}:
                flags = [is_whole(row, width) for row in batch]
                whole = [row for row, good in zip(batch, flags, strict=True) if good]
                if len(whole) < len(batch):
                    left_out += len(batch) - len(whole)
                    first_left_out = first_left_out or count + flags.index(False) + 1
            count += len(batch)
            if not whole_before and whole:
                refuse_words(self.path, whole[0], (*kept, *numbers))
            for column, index in zip(columns, numbers, strict=True):
                read_cells(
                    column, [row[index] for row in whole], whole_before, self.separator != ","
                )
            for text, index in zip(texts, kept, strict=True):
                text.add([row[index] for row in whole])
            whole_before += len(whole)
        self._refuse_none(count, whole_before, left_out)
        self._refuse_mixed(columns)
        return Table(
            kept=tuple(text.joined() for text in texts),
            columns=columns,
            left_out=left_out,
            first_left_out=first_left_out,
        )

    def lines(self) -> Iterator[list[str]]:
        """Cells of the rows that `read` keeps."""
        width = len(self.titles)
        return (row[:width] for row in self._below() if is_whole(row, width))

    def _growing(self, index: int, beside: int) -> GrowingCells | GrowingTimes:
        """Texts of a column; of a large table those of times become numbers as they come."""
        timed = is_time(self.titles[index], self.times)
        if self.most is not None and self.most > BATCH and timed:
            return GrowingTimes(self.most, beside)
        return GrowingCells(None, 1)

    def _below(self) -> Iterator[list[str]]:
        return islice(self.rows(), int(self.has_units), None)

    def _refuse_none(self, count: int, whole: int, left_out: int) -> None:
        if not count:
            raise RecordingRefused(f"{self.path}: the file has a header but no rows below it")
        if not whole:
            hint = "; is the decimal sign also the separator?" if left_out else ""
            raise RecordingRefused(
                f"{self.path}: no row below the header has as many cells as it{hint}"
            )

    def _refuse_mixed(self, columns: Sequence[Column]) -> None:
        for column in columns:
            if len(column.decimals) > 1:
                raise RecordingRefused(
                    f"{self.path}: column '{column.title}' mixes decimal comma and decimal point; "
                    "export the file with one of them"
                )


def text_sheet(
    path: Path,
    name: str,
    titles: Sequence[str],
    rows: Callable[[], Iterator[list[str]]],
    separator: str,
    remarks: tuple[str, ...] = (),
    most: int | None = None,
    times: frozenset[str] = frozenset(),
) -> Sheet:
    """A table of rows of text; `rows` gives them from the one below the titles on, each time anew.

    A row of units below the titles gives the units. Where it is known that there are not more than
    `most` rows, numbers need not stay in memory; `times` are names of columns of times.
    """
    units = units_below(titles, next(rows(), []))
    table = TextTable(path, tuple(titles), rows, separator, units is not None, most, times)
    return Sheet(
        name=name,
        titles=tuple(titles),
        units=units or ("",) * len(titles),
        read=table.read,
        lines=table.lines,
        separator=separator,
        remarks=remarks,
    )
