"""Read a CSV file of any encoding, separator and decimal sign, with any lines above its titles."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from rulec_runtime.recordings.csv_table import RecordingRefused, refuse_columns
from rulec_runtime.recordings.table import Sheet
from rulec_runtime.recordings.text_file import TextFile, text_file
from rulec_runtime.recordings.text_parts import Part, parts_of, rows_of
from rulec_runtime.recordings.text_table import text_sheet
from rulec_runtime.recordings.titles import TitleLine, TitleSearch, left_out_above, rejoined


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """The one table of a CSV file (also .gz): comma, semicolon or tab; decimal point or comma."""
    text = text_file(file, path)
    found = _titles_in(path, text, times)
    start, separator = found.number, found.separator

    def lines_from() -> Iterator[str]:
        return islice(text.opened(), start, None)

    titles = next(rows_of(path, lines_from(), separator), None)
    if titles is None:
        raise RecordingRefused(f"{path}: the file is empty")
    titles = rejoined(titles, separator)

    def below() -> Iterator[list[str]]:
        return islice(rows_of(path, lines_from(), separator), 1, None)

    def parts(above: int, finite: Sequence[int]) -> Iterator[Part]:
        return parts_of(path, lines_from(), separator, 1 + above, (len(titles), finite))

    remarks, timed = left_out_above(found.above), frozenset(times)
    return [text_sheet(path, "", titles, below, separator, remarks, text.lines, timed, parts)]


def _titles_in(path: Path, text: TextFile, times: Collection[str]) -> TitleLine:
    search = TitleSearch(times)
    for line in text.opened():
        refuse_columns(path, max(map(line.count, ",;\t")))
        if found := search.add(line):
            return found
    return search.so_far() or TitleLine(text.lines, ",", 0)
