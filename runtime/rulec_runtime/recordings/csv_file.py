"""A CSV file, whatever its encoding, separator and decimal sign, and whatever stands above it."""

from __future__ import annotations

import csv
import re
from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from rulec_runtime import limits
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.csv_table import (
    RecordingRefused,
    before_header,
    separator_of,
)
from rulec_runtime.recordings.table import Sheet
from rulec_runtime.recordings.text_file import TextFile, text_file
from rulec_runtime.recordings.text_table import text_sheet
from rulec_runtime.recordings.titles import are_titles

_NAMESPACE = re.compile(r"\s*nsu?=[^;]*$")
_IDENTIFIER = re.compile(r"[isgb]=")


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """The one table of a CSV file (also .gz): comma, semicolon or tab; decimal point or comma."""
    text = text_file(file, path)
    start, separator, above = _titles_in(text, times)
    titles = next(_rows(path, text, start, separator), None)
    if titles is None:
        raise RecordingRefused(f"{path}: the file is empty")
    if separator == ";":
        titles = _rejoined(titles)

    def below() -> Iterator[list[str]]:
        rows = _rows(path, text, start, separator)
        next(rows)
        return rows

    remarks = (f"{plural(above, 'line', 'lines')} above the titles left out",) if above else ()
    timed = frozenset(times)
    return [text_sheet(path, "", titles, below, separator, remarks, text.lines, timed)]


def _titles_in(text: TextFile, times: Collection[str]) -> tuple[int, str, int]:
    """The number of the line of titles, its separator, and how many lines above it are no part of
    the table. Where no line looks like titles, the first one holds them."""
    stated = None
    found: list[tuple[int, str]] = []
    for start, line in enumerate(text.opened()):
        separator, is_header = before_header(line)
        stated = separator or stated
        if is_header:
            found.append((start, line))
        if len(found) > limits.LINES_ABOVE_TITLES:
            break
    cut = [(at, line, stated or separator_of(line)) for at, line in found]
    cells = [_cells(line, separator) for _, line, separator in cut]
    likely = [k for k, row in enumerate(cells) if are_titles(row, times)]
    whole = [k for k in likely if k + 1 == len(cells) or len(cells[k + 1]) >= len(cells[k])]
    k = next(iter([*whole, *likely]), 0)
    return (cut[k][0], cut[k][2], k) if cut else (text.lines, ",", 0)


def _cells(line: str, separator: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return []


def _rejoined(titles: list[str]) -> list[str]:
    """Titles of which some are node ids that were cut at their semicolon.

    >>> _rejoined(["time", "ns=2", "s=A.dp", "ns=2;s=A.n"])
    ['time', 'ns=2;s=A.dp', 'ns=2;s=A.n']
    """
    found: list[str] = []
    for title in titles:
        if found and _NAMESPACE.match(found[-1]) and _IDENTIFIER.match(title):
            found[-1] = f"{found[-1]};{title}"
        else:
            found.append(title)
    return found


def _rows(path: Path, text: TextFile, start: int, separator: str) -> Iterator[list[str]]:
    """Rows that hold anything, from a line of the text on."""
    lines = islice(text.opened(), start, None)
    try:
        for row in csv.reader(lines, delimiter=separator):
            if any(row):
                yield row
    except csv.Error as error:
        raise RecordingRefused(f"{path}: not a readable CSV file ({error})") from None
