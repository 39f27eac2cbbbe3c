"""Read annotated CSV, the answer of InfluxDB to queries: consecutive tables, each with its head.

Source: InfluxData, Annotated CSV.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from rulec_runtime.recordings.csv_table import RecordingRefused, rows_of
from rulec_runtime.recordings.table import Sheet
from rulec_runtime.recordings.text_file import TextFile
from rulec_runtime.recordings.text_table import text_sheet

BEGINS = ("#group", "#datatype", "#default")
TIME, VALUE, FIELD, MEASUREMENT = "_time", "_value", "_field", "_measurement"

_NO_READINGS = ("", "result", "table", "_start", "_stop", TIME)
_NUMBERS = ("double", "long", "unsignedLong")

Series = tuple[tuple[str, str], ...]
"""Key of a series: titles with their cells."""


@dataclass(frozen=True)
class _Head:
    """Titles of a table, with type, default for an empty cell, and membership in the group key."""

    titles: tuple[str, ...]
    types: Mapping[str, str]
    defaults: Mapping[str, str]
    group: frozenset[str]

    @property
    def readings(self) -> list[str]:
        """Columns of readings: the value or, in a pivoted table, all numbers."""
        if VALUE in self.titles:
            return [VALUE]
        return [
            t for t in self.titles
            if t not in _NO_READINGS and t not in self.group and self.types.get(t) in _NUMBERS
        ]  # fmt: skip


def sheets(file: BinaryIO, path: Path, _: Collection[str]) -> list[Sheet]:
    """The readings of all tables, one per row."""
    text = TextFile(file, path)
    series = {key for key, _, _ in _cells(text)}
    if not series:
        raise RecordingRefused(f"{path}: no table in it has a column '{TIME}' and readings")
    names = _names(series)

    def rows() -> Iterator[list[str]]:
        return ([names[key], time, value] for key, time, value in _cells(text))

    return [text_sheet(path, "", ["tag", "time", "value"], rows, ",")]


def _names(series: set[Series]) -> dict[Series, str]:
    """Names of series: measurement, tags and field, without constant parts; a measurement stays
    before fields that name no module."""
    values: dict[str, set[str]] = {}
    for key in series:
        for title, cell in key:
            values.setdefault(title, set()).add(cell)
    bare = any("." not in cell for cell in values[FIELD])
    used = {t for t, cells in values.items() if len(cells) > 1 or t == FIELD}
    used |= {MEASUREMENT} if bare and not used - {FIELD} else set()
    return {key: ".".join(cell for title, cell in key if title in used) for key in series}


def _cells(text: TextFile) -> Iterator[tuple[Series, str, str]]:
    """Series, time and value of each reading."""
    for head, row in _tables(text):
        cells = {
            title: cell or head.defaults.get(title, "")
            for title, cell in zip(head.titles, row, strict=False)
        }
        for title in head.readings if TIME in cells else ():
            yield _series(head, cells, title), cells[TIME], cells[title]


def _series(head: _Head, cells: Mapping[str, str], title: str) -> Series:
    """Key of a series: measurement, tags in the order of their columns, field."""
    field = cells.get(FIELD, "") if title == VALUE else title
    tags = [
        (t, cells[t]) for t in head.titles
        if t in head.group and t not in (*_NO_READINGS, FIELD, MEASUREMENT)
    ]  # fmt: skip
    return ((MEASUREMENT, cells.get(MEASUREMENT, "")), *tags, (FIELD, field))


def _tables(text: TextFile) -> Iterator[tuple[_Head, Sequence[str]]]:
    """Rows with the head of their table; annotations, or a row of titles, begin another table."""
    notes: dict[str, list[str]] = {}
    head: _Head | None = None
    for row in rows_of(text.path, text.lines(), ","):
        if row[0] in BEGINS:
            notes = {} if head is not None else notes
            notes[row[0]], head = row, None
        elif head is None or (TIME in row and "table" in row):
            head = _head(row, notes)
        else:
            yield head, row


def _head(titles: Sequence[str], notes: Mapping[str, Sequence[str]]) -> _Head:
    group, types, defaults = (
        dict(zip(islice(titles, 1, None), islice(notes.get(name, ()), 1, None), strict=False))
        for name in BEGINS
    )
    return _Head(tuple(titles), types, defaults, frozenset(t for t in group if group[t] == "true"))
