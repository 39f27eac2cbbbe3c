"""A CSV file as written: header and cells, whatever its encoding, separator and decimal sign."""

from __future__ import annotations

import csv
import gzip
import io
import os
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.refusal import Refusal

BATCH = 20_000
"""Rows read at a time: cells become numbers before the next rows are read."""

PIECE = 1 << 20

BLANK = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})
"""Cells that say "no value" without being a surprise."""


class RecordingRefused(Refusal):
    """The file cannot be used as a recording; the message says why and what to do."""


@dataclass
class Column:
    """The numbers of a column; NaN where a cell is empty or a word.

    `words` counts the words, `first` is one of them with its data row (from 1). `decimals` are
    the decimal signs seen.
    """

    title: str
    parts: list[Array] = field(default_factory=list)
    words: int = 0
    first: tuple[int, str] | None = None
    decimals: set[str] = field(default_factory=set)

    def numbers(self) -> Array:
        """All numbers, shape (n,)."""
        return np.concatenate(self.parts)


@dataclass(frozen=True)
class Table:
    """The wanted columns of a file: one kept as text (times), the others as numbers."""

    text: list[str]
    columns: tuple[Column, ...]
    left_out: int
    first_left_out: int


Choice = Callable[[Sequence[str]], tuple[int, Sequence[int]]]
"""From a header to the index of the column kept as text and those of the number columns."""


def read_table(path: Path, choose: Choice) -> Table:
    """Read a CSV file (also .gz): comma, semicolon or tab; decimal point or comma.

    Rows with another number of cells than the header are left out, as no cell of them can be
    trusted. Raises `RecordingRefused`.
    """
    header, rows, separator = _opened(path)
    text_index, indexes = choose(header)
    columns = tuple(Column(header[i].strip()) for i in indexes)
    kept: list[str] = []
    count = left_out = first_left_out = 0
    while batch := list(islice(rows, BATCH)):
        whole = []
        for row in batch:
            count += 1
            if is_whole(row, len(header)):
                whole.append(row)
            else:
                left_out, first_left_out = left_out + 1, first_left_out or count
        if not kept and whole:
            refuse_words(path, whole[0], (text_index, *indexes))
        for column, index in zip(columns, indexes, strict=True):
            read_cells(column, [row[index] for row in whole], len(kept), separator != ",")
        kept += [row[text_index] for row in whole]
    if not count:
        raise RecordingRefused(f"{path}: the file has a header but no rows below it")
    if not kept:
        hint = "; is the decimal sign also the separator?" if left_out else ""
        raise RecordingRefused(f"{path}: no row below the header has as many cells as it{hint}")
    for column in columns:
        if len(column.decimals) > 1:
            raise RecordingRefused(
                f"{path}: column '{column.title}' mixes decimal comma and decimal point; "
                "export the file with one of them"
            )
    return Table(kept, columns, left_out, first_left_out)


def whole_rows(path: Path) -> tuple[list[str], Iterator[list[str]], str]:
    """Header, cells of the rows that `read_table` keeps, and separator of a file."""
    header, rows, separator = _opened(path)
    width = len(header)
    return header, (row[:width] for row in rows if is_whole(row, width)), separator


def _opened(path: Path) -> tuple[list[str], Iterator[list[str]], str]:
    rows, separator = _rows(path, _text(path))
    header = next(rows, None)
    if header is None:
        raise RecordingRefused(f"{path}: the file is empty")
    return header, rows, separator


def _text(path: Path) -> str:
    """Content of a file; UTF-8 or UTF-16 with mark, else Latin-1, which takes every byte."""
    try:
        raw = _bytes(path)
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


def _bytes(path: Path) -> bytes:
    """Bytes of a file, unpacked piece by piece, so that a small file cannot fill the memory."""
    with path.open("rb") as file:
        packed = file.read(2) == b"\x1f\x8b"
        file.seek(0)
        if not packed:
            return file.read()
        most = max(limits.FREE_TO_UNPACK, limits.DENSEST * os.fstat(file.fileno()).st_size)
        pieces: list[bytes] = []
        with gzip.GzipFile(fileobj=file) as unpacked:
            while piece := unpacked.read(PIECE):
                pieces.append(piece)
                most -= len(piece)
                if most < 0:
                    raise RecordingRefused(
                        f"{path}: it unpacks to more than {limits.DENSEST} times its size, as no "
                        "recording does; if it is one, unpack it first"
                    )
    return b"".join(pieces)


def _rows(path: Path, text: str) -> tuple[Iterator[list[str]], str]:
    """Rows that hold anything, behind blank lines, comments and Excel's ``sep=``."""
    lines = io.StringIO(text, newline="")
    start, first, separator = 0, "", None
    while first := lines.readline():
        stated, is_header = before_header(first)
        separator = stated or separator
        if is_header:
            break
        start = lines.tell()
    lines.seek(start)
    separator = separator or separator_of(first)

    def rows() -> Iterator[list[str]]:
        try:
            for row in csv.reader(lines, delimiter=separator):
                if any(row):
                    yield row
        except csv.Error as error:
            raise RecordingRefused(f"{path}: not a readable CSV file ({error})") from None

    return rows(), separator


def before_header(line: str) -> tuple[str | None, bool]:
    """The separator that a line states (Excel's ``sep=``), and whether it is the header.

    Blank lines and comments stand before it, too.

    >>> before_header("sep=;"), before_header("# a remark"), before_header("time,A.dp")
    ((';', False), (None, False), (None, True))
    """
    text = line.strip().strip('"')
    if text.lower().startswith("sep=") and len(text) == 5:
        return text[4], False
    return None, bool(text) and not text.startswith("#")


def separator_of(header: str) -> str:
    """The separator that stands in a header most often."""
    return max((";", "\t", ","), key=header.count)


def is_whole(row: Sequence[str], width: int) -> bool:
    """Whether a row has all cells of the header, and none but blank ones behind them."""
    return len(row) >= width and not any(cell.strip() for cell in row[width:])


def refuse_words(path: Path, row: Sequence[str], indexes: Iterable[int]) -> None:
    """A line of units below the header would be lost, and the units with it."""
    cells = [row[i].strip() for i in indexes]
    if len(cells) > 1 and all(_is_word(cell) for cell in cells):
        shown = ", ".join(cells[:4])
        raise RecordingRefused(
            f"{path}: the line below the header holds words ({shown}); put the unit of a column "
            "into its header, as in 'A.dp [bar]', and take this line out"
        )


def _is_word(cell: str) -> bool:
    return cell.lower() not in BLANK and not any(c.isdigit() for c in cell)


def read_cells(column: Column, cells: list[str], before: int, comma: bool) -> None:
    """Append cells to a column as numbers, behind `before` rows; `comma`: it may be decimal."""
    if comma:
        column.decimals |= {sign for sign in ",." if any(sign in cell for cell in cells)}
        if "," in column.decimals:
            cells = [cell.replace(",", ".") for cell in cells]
    try:
        column.parts.append(np.array(cells, dtype=float))
        return
    except ValueError:
        pass
    numbers = np.full(len(cells), np.nan)
    for i, cell in enumerate(cells):
        try:
            numbers[i] = float(cell)
        except ValueError:
            if cell.strip().lower() not in BLANK:
                column.words += 1
                column.first = column.first or (before + i + 1, cell.strip()[:30])
    column.parts.append(numbers)
