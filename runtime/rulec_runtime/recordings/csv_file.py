"""A CSV file, whatever its encoding, separator and decimal sign, and whatever stands above it."""

from __future__ import annotations

import csv
import gzip
import io
import os
import re
import zlib
from collections.abc import Collection, Iterator
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
from rulec_runtime.recordings.text_table import text_sheet
from rulec_runtime.recordings.titles import are_titles
from rulec_runtime.recordings.unpacking import refuse_bomb

PIECE = 1 << 20

_NAMESPACE = re.compile(r"\s*nsu?=[^;]*$")
_IDENTIFIER = re.compile(r"[isgb]=")


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """The one table of a CSV file (also .gz): comma, semicolon or tab; decimal point or comma."""
    text = _text(file, path)
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
    return [text_sheet(path, "", titles, below, separator, remarks)]


def _titles_in(text: str, times: Collection[str]) -> tuple[int, str, int]:
    """Where the line of titles begins, its separator, and how many lines above it are no part of
    the table. Where no line looks like titles, the first one holds them."""
    lines = io.StringIO(text, newline="")
    stated = None
    found: list[tuple[int, str]] = []
    while len(found) <= limits.LINES_ABOVE_TITLES:
        start = lines.tell()
        line = lines.readline()
        if not line:
            break
        separator, is_header = before_header(line)
        stated = separator or stated
        if is_header:
            found.append((start, line))
    cut = [(at, line, stated or separator_of(line)) for at, line in found]
    cells = [_cells(line, separator) for _, line, separator in cut]
    likely = [k for k, row in enumerate(cells) if are_titles(row, times)]
    whole = [k for k in likely if k + 1 == len(cells) or len(cells[k + 1]) >= len(cells[k])]
    k = next(iter([*whole, *likely]), 0)
    return (cut[k][0], cut[k][2], k) if cut else (len(text), ",", 0)


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


def _text(file: BinaryIO, path: Path) -> str:
    """Content of a file; UTF-8 or UTF-16 with mark, else Latin-1, which takes every byte."""
    try:
        raw = _bytes(file, path)
    except (OSError, EOFError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or error
        raise RecordingRefused(f"{path}: cannot be read ({reason}); copy it again") from None
    encoding = "utf-16" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = raw.decode(encoding)
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    if "\0" in text:
        raise RecordingRefused(f"{path}: this is a binary file; export the recording as CSV")
    return text


def _bytes(file: BinaryIO, path: Path) -> bytes:
    """Bytes of a file, unpacked piece by piece, so that a small file cannot fill the memory."""
    packed = file.read(2) == b"\x1f\x8b"
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    if not packed:
        return file.read()
    pieces: list[bytes] = []
    total = 0
    with gzip.GzipFile(fileobj=file) as unpacked:
        while piece := unpacked.read(PIECE):
            pieces.append(piece)
            total += len(piece)
            refuse_bomb(path, total, size)
    return b"".join(pieces)


def _rows(path: Path, text: str, start: int, separator: str) -> Iterator[list[str]]:
    """Rows that hold anything, from a place in the text on."""
    lines = io.StringIO(text, newline="")
    lines.seek(start)
    try:
        for row in csv.reader(lines, delimiter=separator):
            if any(row):
                yield row
    except csv.Error as error:
        raise RecordingRefused(f"{path}: not a readable CSV file ({error})") from None
