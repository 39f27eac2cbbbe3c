"""Tables whose rows are text, from CSV files of any encoding, separator and decimal sign, and from
spreadsheets."""

from collections.abc import Callable, Collection, Iterator, Sequence, Set
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from rulec_runtime import limits
from rulec_runtime.contract.file_form import INFERRED, FileForm
from rulec_runtime.recordings.arrays import GrowingCells, GrowingTimes
from rulec_runtime.recordings.csv_table import (
    Column,
    Convention,
    RecordingRefused,
    Signs,
    Unclear,
    columns_of,
    convention_of,
    is_whole,
    read_cells,
    refuse_columns,
    refuse_words,
    rows_of,
)
from rulec_runtime.recordings.table import Sheet, Table
from rulec_runtime.recordings.text_file import TextFile
from rulec_runtime.recordings.time_column import order_in
from rulec_runtime.recordings.titles import (
    is_time,
    left_out_above,
    rejoined,
    title_line,
    units_below,
)

BATCH = 1000
"""Rows read at a time: cells become numbers while they are still in the cache."""


@dataclass(frozen=True)
class TextTable:
    """Titles of a table, and a function that gives the rows below them, each call anew."""

    path: Path
    titles: tuple[str, ...]
    rows: Callable[[], Iterator[list[str]]]
    separator: str
    has_units: bool
    times: frozenset[str]

    def read(self, raw: Sequence[int], numbers: Sequence[int], form: FileForm = INFERRED) -> Table:
        """Read columns; rows with a wrong number of cells are left out, since none of their cells
        can be trusted. Raises `RecordingRefused`."""
        sample = list(islice(self.lines(), limits.SHOWING_ROWS))
        notes = list[str]()
        written = conventions(self.path, self.titles, sample, numbers, self.separator, form)
        columns = columns_of(self.titles, numbers, written, form)
        parts = {index for index in raw if is_time(self.titles[index], self.times)}
        texts = tuple(self._growing(index, parts, form, notes) for index in raw)
        width, below = len(self.titles), self._below()
        count = whole = first_left_out = 0
        while part := list(islice(below, BATCH)):
            even = {*map(len, part)} == {width}
            rows = part if even else [row for row in part if is_whole(row, width)]
            if len(rows) < len(part) and not first_left_out:
                odd = next(k for k, row in enumerate(part) if not is_whole(row, width))
                first_left_out = count + odd + 1
            if not whole and rows and numbers:
                refuse_words(self.path, rows[0], (*raw, *numbers))
            for column, index in zip(columns, numbers, strict=True):
                read_cells(column, [row[index] for row in rows], whole, self.separator != ",")
            for text, index in zip(texts, raw, strict=True):
                text.add([row[index] for row in rows])
            count, whole = count + len(part), whole + len(rows)
        self._check(count, whole, columns)
        marks = sorted({f"'{mark}'" for column in columns for mark in column.written.thousands})
        if marks and not form.thousands:
            notes.insert(0, f"{' and '.join(marks)} in its numbers marks thousands")
        return Table(
            raw=tuple(text.joined() for text in texts),
            columns=columns,
            remarks=tuple(notes),
            left_out=count - whole,
            first_left_out=first_left_out,
        )

    def lines(self) -> Iterator[list[str]]:
        """Cells of the rows that `read` keeps."""
        width = len(self.titles)
        return (row[:width] for row in self._below() if is_whole(row, width))

    def _growing(
        self, index: int, times: Set[int], form: FileForm, notes: list[str]
    ) -> GrowingCells | GrowingTimes:
        """Collects the texts of a column; those of the only column of times become numbers at
        once, while of several each may be a part of the time."""
        if {index} == times and len(form.time) < 2:
            order = order_in(self.path, lambda: (row[index] for row in self.lines()), form, notes)
            return GrowingTimes(self.path, order)
        return GrowingCells()

    def _below(self) -> Iterator[list[str]]:
        return islice(self.rows(), int(self.has_units), None)

    def _check(self, count: int, whole: int, columns: Sequence[Column]) -> None:
        if not count:
            raise RecordingRefused(f"{self.path}: the file has a header but no rows below it")
        if not whole:
            raise RecordingRefused(
                f"{self.path}: no row below the header has as many cells as it; is the decimal "
                "sign also the separator?"
            )
        for column in columns:
            if len(column.decimals) > 1:
                raise RecordingRefused(
                    f"{self.path}: column '{column.title}' mixes decimal comma and decimal point; "
                    "export the file with one of them"
                )


def conventions(
    path: Path,
    titles: Sequence[str],
    sample: Sequence[Sequence[str]],
    numbers: Sequence[int],
    separator: str,
    form: FileForm,
) -> list[Convention]:
    """The conventions of columns of numbers, by the first rows. Raises `Unclear` if a cell could be
    two numbers."""
    signs = [Signs() for _ in titles]
    for column, cells in zip(signs, zip(*sample, strict=False), strict=False):
        column.see(cells)
    whole, found = Signs(), []
    for column in signs:
        whole.decimal |= column.decimal
        whole.thousands |= column.thousands
    for index in numbers:
        one = convention_of(signs[index], whole, form, separator)
        if isinstance(one, str):
            mark = "," if "," in one else "."
            raise Unclear(
                f"{path}: column '{titles[index].strip()}': '{one}' may be "
                f"{one.replace(mark, '')} or {one.replace(mark, '.')}; say which in the column "
                f"map, as in 'file: {{thousands: \"{mark}\"}}' or 'file: {{decimal: \"{mark}\"}}'",
                [{"thousands": mark, "decimal": ",."[mark == ","]}, {"decimal": mark}],
                likely=bool(whole.decimal - {mark}),
            )
        found.append(one)
    return found


def text_sheet(
    path: Path,
    name: str,
    titles: Sequence[str],
    rows: Callable[[], Iterator[list[str]]],
    separator: str,
    remarks: tuple[str, ...] = (),
    times: frozenset[str] = frozenset(),
) -> Sheet:
    """A table of rows of text; each call of `rows` gives those below the titles.

    A row of units below the titles gives the units. `times` are names of time columns, whose cells
    need not stay in memory as text. A logger that starts again may repeat its titles.
    """
    named = [*titles]

    def below() -> Iterator[list[str]]:
        return (row for row in rows() if row != named)

    units = units_below(titles, next(below(), []))
    table = TextTable(path, tuple(titles), below, separator, units is not None, times)
    return Sheet(
        name=name,
        titles=tuple(titles),
        units=units or ("",) * len(titles),
        read=table.read,
        lines=table.lines,
        separator=separator,
        remarks=remarks,
    )


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """The one table of a CSV file (also .gz): comma, semicolon or tab; decimal point or comma."""
    text = TextFile(file, path)

    def narrow() -> Iterator[str]:
        for line in text.lines():
            refuse_columns(path, max(map(line.count, ",;\t")))
            yield line

    found = title_line(narrow(), times)
    if found is None:
        raise RecordingRefused(f"{path}: the file is empty")
    start, separator = found.number, found.separator

    def rows() -> Iterator[list[str]]:
        return rows_of(path, islice(text.lines(), start, None), separator)

    titles = next(rows(), None)
    if titles is None:
        raise RecordingRefused(f"{path}: the file is empty")
    titles = rejoined(titles, separator)
    remarks, timed = left_out_above(found.above), frozenset(times)

    def below() -> Iterator[list[str]]:
        return islice(rows(), 1, None)

    return [text_sheet(path, "", titles, below, separator, remarks, timed)]
