"""Lines and cells of a CSV file: titles, separators and numbers.

How numbers are written, their decimal sign and thousands marks, is inferred from the cells.
"""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rulec_runtime.contract.file_form import FileForm
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.larger_than_memory import Growing

SPACES = " \u00a0\u202f\u2009'\u2019"
"""Thousands marks that are no decimal sign anywhere."""

_SHAPE = re.compile(rf"[+-]?(?P<body>\d[\d.,{SPACES}]*|[.,]\d+)(?:[eE][+-]?\d+)?")
_GROUPS = {
    mark: re.compile(rf"[1-9]\d{{0,2}}(?:{re.escape(mark)}\d{{3}})+") for mark in f".,{SPACES}"
}


@dataclass(frozen=True)
class Convention:
    """A `decimal` sign, empty if none was found, and marks of `thousands`."""

    decimal: str = ""
    thousands: str = ""

    def plain(self, cell: str) -> str:
        """A number as every program reads it; a cell with wrong groups becomes no number.

        >>> Convention(",", ".").plain("1.234,5"), Convention(",", ".").plain("1.5")
        ('1234.5', '1.5,')
        """
        text = cell.strip()
        for mark in self.thousands:
            if mark in text:
                whole, sign, rest = text.lstrip("+-").partition(self.decimal or "\0")
                if not _GROUPS[mark].fullmatch(whole) or mark in rest:
                    return f"{text},"  # no number in any convention
                minus = "-" if text.startswith("-") else ""
                text = f"{minus}{whole.replace(mark, '')}{sign}{rest}"
        return text.replace(",", ".") if self.decimal == "," else text


UNKNOWN = Convention()


@dataclass
class Signs:
    """Signs found in cells: surely `decimal`, surely of `thousands`, or `either`, each of these
    with its first cell."""

    decimal: set[str] = field(default_factory=set)
    thousands: set[str] = field(default_factory=set)
    either: dict[str, str] = field(default_factory=dict)

    def see(self, cells: Iterable[str]) -> None:
        """Take in further cells."""
        for cell in cells:
            text = cell.strip()
            match = None if text.isdigit() else _SHAPE.fullmatch(text)
            if match is None:
                continue
            body = match["body"]
            last = max(body.rfind("."), body.rfind(","))
            if last < 0:
                self.thousands |= {m for m in SPACES if m in body and _GROUPS[m].fullmatch(body)}
                continue
            sign, marks = body[last], {mark for mark in body[:last] if mark in f".,{SPACES}"}
            if marks == {sign}:
                self.thousands |= marks if _GROUPS[sign].fullmatch(body) else set()
            elif len(marks) == 1:
                if _GROUPS[min(marks)].fullmatch(body[:last]):
                    self.decimal.add(sign)
                    self.thousands |= marks
            elif not marks and _GROUPS[sign].fullmatch(body):
                self.either.setdefault(sign, text)
            elif not marks:
                self.decimal.add(sign)


def convention_of(own: Signs, file: Signs, form: FileForm, separator: str) -> Convention | str:
    """The convention of a column, by its `own` signs, those of its whole `file`, and the column
    map; or else a cell that could be two numbers.

    >>> german, column = Signs(), Signs()
    >>> german.see(["1,5"]); column.see(["54.054"])
    >>> convention_of(column, german, FileForm(), ";")
    '54.054'
    >>> convention_of(column, german, FileForm(thousands="."), ";")
    Convention(decimal=',', thousands='.')
    """
    if form.decimal or form.thousands:
        stated = form.decimal or ("," if "." in form.thousands else ".")
        return Convention(stated, form.thousands or "".join(sorted(file.thousands - {stated})))
    thousands = {*own.thousands, *(file.thousands & set(SPACES))}
    decimal: str = next(iter(own.decimal)) if len(own.decimal) == 1 else ""
    for sign, cell in own.either.items():
        if decimal or sign in thousands:
            thousands |= {sign} - {decimal}
        elif sign in file.decimal - file.thousands and len(file.decimal) == 1:
            decimal = sign
        elif sign in file.thousands - file.decimal:
            thousands.add(sign)
        elif sign == "." and separator == "," and "," not in file.decimal:
            decimal = sign
        else:
            return cell
    if not decimal and len(file.decimal) == 1 and not file.decimal & thousands:
        decimal = next(iter(file.decimal))
    return Convention(decimal, "".join(sorted(thousands - {decimal})))


_QUOTED = re.compile(r'"[^"]*"')
_NODE_ID = re.compile(r"\b(?:nsu?=[^;,\t]*;)?[isgb]=")
"""An OPC UA node id, ns=2;s=A.dp: its semicolon is not a separator."""

BLANK = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})
"""Usual cells for a missing value."""


class RecordingRefused(Refusal):
    """The file cannot be used as a recording; the message says why and what to do."""


def refuse_columns(path: Path, count: int) -> None:
    """Raise `RecordingRefused` if a table has too many columns."""
    if count > limits.MOST_COLUMNS:
        raise RecordingRefused(
            f"{path}: a table with more than {limits.MOST_COLUMNS} columns; export those of this "
            "plant alone"
        )


class Unclear(RecordingRefused):
    """The file can be read in several ways. `choices` are the entries of a column map that would
    settle it; `likely`: the first of them is."""

    def __init__(self, text: str, choices: Sequence[Mapping[str, Any]], likely: bool) -> None:
        super().__init__(text)
        self.choices, self.likely = choices, likely


@dataclass
class Column:
    """The numbers of a column; NaN where a cell is empty or a word.

    `states` counts the words; `first` is the first with its data row (from 1); `placed` are all of
    them by row (from 0), None if not wanted. `written` is the convention of its numbers, `decimals`
    are the decimal signs found.
    """

    title: str
    parts: Growing = field(default_factory=Growing)
    states: Counter[str] = field(default_factory=Counter)
    first: tuple[int, str] | None = None
    decimals: set[str] = field(default_factory=set)
    written: Convention = UNKNOWN
    placed: dict[int, str] | None = None

    @property
    def words(self) -> int:
        """Number of cells that are words."""
        return self.states.total()

    def say(self, row: int, word: str) -> None:
        """Record a word in a row, from 0."""
        self.states[word] += 1
        self.first = self.first or (row + 1, word)
        if self.placed is not None:
            self.placed[row] = word

    def numbers(self) -> Array:
        """All numbers, shape (n,)."""
        return self.parts.joined()


def columns_of(
    titles: Sequence[str], indexes: Sequence[int], written: Sequence[Convention], form: FileForm
) -> tuple[Column, ...]:
    """Columns to be read, each with the convention of its numbers."""
    return tuple(
        Column(titles[i].strip(), written=one, placed={} if form.words_are_placed else None)
        for i, one in zip(indexes, written, strict=True)
    )


def before_header(line: str) -> tuple[str | None, bool]:
    """The separator that a line states (Excel's ``sep=``), and whether it is the header.

    Blank lines and comments may come before the header, too.

    >>> before_header("sep=;"), before_header("# a remark"), before_header("time,A.dp")
    ((';', False), (None, False), (None, True))
    """
    text = line.strip().strip('"')
    if text.lower().startswith("sep=") and len(text) == 5:
        return text[4], False
    return None, bool(text) and not text.startswith("#")


def separator_of(header: str) -> str:
    """The most frequent separator of a header, outside quotes and node ids.

    >>> separator_of('time,ns=2;s=A.dp,"ns=2;s=A.Q;x"')
    ','
    """
    plain = _NODE_ID.sub("", _QUOTED.sub("", header))
    return max((";", "\t", ",", "|"), key=plain.count)


def cells_of(line: str, separator: str) -> list[str]:
    """Cells of one line; a line that cannot be split is one cell.

    >>> cells_of('0,"1,5"', ","), cells_of("0,1", ",")
    (['0', '1,5'], ['0', '1'])
    """
    line = line.rstrip("\r\n")
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return [line]


def rows_of(path: Path, lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    """Cells of the rows that are not empty. Raises `RecordingRefused`."""
    try:
        yield from filter(any, csv.reader(lines, delimiter=separator))
    except csv.Error as error:
        # A cell may hold anything else: only an unclosed quote makes one too large.
        raise RecordingRefused(
            f'{path}: not a readable CSV file ({error}); look for a quote (") that is not closed'
        ) from None


def is_whole(row: Sequence[str], width: int) -> bool:
    """Whether a row has all cells of the header, followed only by blank ones."""
    return len(row) >= width and not any(cell.strip() for cell in row[width:])


def refuse_words(path: Path, row: Sequence[str], indexes: Iterable[int]) -> None:
    """Refuse a line of units below the header: the units would be lost."""
    cells = [row[i].strip() for i in indexes]
    words = [c for c in cells if c.lower() not in BLANK and not any(map(str.isdigit, c))]
    if len(words) == len(cells) > 1:
        shown = ", ".join(cells[:4])
        raise RecordingRefused(
            f"{path}: the line below the header holds words ({shown}); put the unit of a column "
            "into its header, as in 'A.dp [bar]', and take this line out"
        )


def read_cells(column: Column, cells: list[str], before: int, comma: bool) -> None:
    """Append cells to a column as numbers, after `before` rows; `comma`: it may be decimal."""
    if column.written.thousands:
        cells = [column.written.plain(cell) for cell in cells]
    elif comma or column.written.decimal == ",":
        # A word such as k.A. has no decimal sign.
        column.decimals |= {
            sign
            for sign in ",."
            if any(sign in cell and _SHAPE.fullmatch(cell.strip()) for cell in cells)
        }
        if "," in column.decimals:
            cells = [cell.replace(",", ".") for cell in cells]
    numbers, others = numbers_in(cells)
    for row in others:
        if cells[row].strip().lower() not in BLANK:
            column.say(before + row, cells[row].strip()[:30])
    column.parts.append(numbers)


def numbers_in(cells: Sequence[str]) -> tuple[Array, list[int]]:
    """Cells as numbers, shape (n,), and the positions of those that are none and become NaN."""
    try:
        return np.array(cells, dtype=float), []
    except ValueError:
        numbers, others = np.full(len(cells), np.nan), []
    for i, cell in enumerate(cells):
        try:
            numbers[i] = float(cell)
        except ValueError:
            others.append(i)
    return numbers, others


def refuse_bomb(path: Path, unpacked: int, size: int) -> None:
    """Raise `RecordingRefused` if a file of `size` bytes unpacks to too many."""
    if unpacked > max(limits.FREE_TO_UNPACK, limits.DENSEST * size):
        raise RecordingRefused(
            f"{path}: it unpacks to more than {limits.DENSEST} times its size, as no "
            "recording does; if it is one, unpack it first"
        )
