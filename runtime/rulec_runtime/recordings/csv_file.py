"""A CSV file, whatever its encoding, separator and decimal sign, and whatever stands above it."""

from __future__ import annotations

import csv
from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.table import Sheet
from rulec_runtime.recordings.text_file import TextFile, text_file
from rulec_runtime.recordings.text_table import text_sheet
from rulec_runtime.recordings.title_search import TitleLine, TitleSearch
from rulec_runtime.recordings.titles import left_out_above, rejoined


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """The one table of a CSV file (also .gz): comma, semicolon or tab; decimal point or comma."""
    text = text_file(file, path)
    found = _titles_in(text, times)
    start, separator = found.number, found.separator
    titles = next(_rows(path, text, start, separator), None)
    if titles is None:
        raise RecordingRefused(f"{path}: the file is empty")
    titles = rejoined(titles, separator)

    def below() -> Iterator[list[str]]:
        rows = _rows(path, text, start, separator)
        next(rows)
        return rows

    remarks, timed = left_out_above(found.above), frozenset(times)
    return [text_sheet(path, "", titles, below, separator, remarks, text.lines, timed)]


def _titles_in(text: TextFile, times: Collection[str]) -> TitleLine:
    search = TitleSearch(times)
    for line in text.opened():
        if found := search.add(line):
            return found
    return search.so_far() or TitleLine(text.lines, ",", 0)


def _rows(path: Path, text: TextFile, start: int, separator: str) -> Iterator[list[str]]:
    """Rows that hold anything, from a line of the text on."""
    lines = islice(text.opened(), start, None)
    try:
        yield from filter(any, csv.reader(lines, delimiter=separator))
    except csv.Error as error:
        raise RecordingRefused(f"{path}: not a readable CSV file ({error})") from None
