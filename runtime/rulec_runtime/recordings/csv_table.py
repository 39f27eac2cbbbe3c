"""Lines and cells of a CSV file: where its titles are, what separates them, what is a number."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings.numbers import UNKNOWN, Convention
from rulec_runtime.recordings.scratch import Growing

_QUOTED = re.compile(r'"[^"]*"')
_NODE_ID = re.compile(r"\b(?:nsu?=[^;,\t]*;)?[isgb]=")
"""An OPC UA node id, ns=2;s=A.dp: its semicolon separates nothing."""

BLANK = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})
"""Cells that say "no value" without being a surprise."""


class RecordingRefused(Refusal):
    """The file cannot be used as a recording; the message says why and what to do."""


def refuse_columns(path: Path, count: int) -> None:
    """Raise `RecordingRefused` where a table has too many columns."""
    if count > limits.MOST_COLUMNS:
        raise RecordingRefused(
            f"{path}: a table with more than {limits.MOST_COLUMNS} columns; export those of this "
            "plant alone"
        )


class Unclear(RecordingRefused):
    """The file may be read in several ways. `choices` are what a column map would say of its form;
    the first of them is `likely`, or none is."""

    def __init__(self, text: str, choices: Sequence[Mapping[str, Any]], likely: bool) -> None:
        super().__init__(text)
        self.choices, self.likely = choices, likely


@dataclass
class Column:
    """The numbers of a column; NaN where a cell is empty or a word.

    `states` counts the words, and `first` is one of them with its data row (from 1); `placed` are
    all of them by row (from 0), None where nobody asks. `written` says how its numbers are,
    `decimals` are the decimal signs seen.
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
        """How many cells are words."""
        return self.states.total()

    def say(self, row: int, word: str) -> None:
        """A word stands in a row, from 0."""
        self.states[word] += 1
        self.first = self.first or (row + 1, word)
        if self.placed is not None:
            self.placed[row] = word

    def add(self, numbers: Array, comma: bool) -> None:
        """Numbers behind those that are there; `comma`: they might have had a decimal comma."""
        if comma and not np.all(np.isnan(numbers) | (numbers == np.floor(numbers))):
            self.decimals.add(".")
        self.parts.append(numbers)

    def numbers(self) -> Array:
        """All numbers, shape (n,)."""
        return self.parts.joined()


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
    """The separator that stands in a header most often, outside of quotes and node ids.

    >>> separator_of('time,ns=2;s=A.dp,"ns=2;s=A.Q;x"')
    ','
    """
    plain = _NODE_ID.sub("", _QUOTED.sub("", header))
    return max((";", "\t", ",", "|"), key=plain.count)


def cells_of(line: str, separator: str) -> list[str]:
    """Cells of one line; a line that cannot be cut is one cell.

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
    if column.written.thousands:
        cells = [column.written.plain(cell) for cell in cells]
    elif comma or column.written.decimal == ",":
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
                word = cell.strip()[:30]
                column.say(before + i, word)
    column.parts.append(numbers)


def refuse_bomb(path: Path, unpacked: int, size: int) -> None:
    """Raise `RecordingRefused` where a file of `size` bytes unpacks to too many."""
    if unpacked > max(limits.FREE_TO_UNPACK, limits.DENSEST * size):
        raise RecordingRefused(
            f"{path}: it unpacks to more than {limits.DENSEST} times its size, as no "
            "recording does; if it is one, unpack it first"
        )
