"""Find the titles of a table: after lines that belong to no table, before a row of units."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from rulec_runtime.contract.file_form import FileForm
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import (
    BLANK,
    before_header,
    cells_of,
    is_whole,
    separator_of,
)
from rulec_runtime.recordings.header import parts_of
from rulec_runtime.recordings.time_column import NAMES

_NAMESPACE = re.compile(r"\s*nsu?=[^;]*$")
_IDENTIFIER = re.compile(r"[isgb]=")
_MARKS = re.compile(r"[.,](?=\d)")
_DATE = re.compile(
    r"\d{1,4}[-./:]\d|\d{1,2}\.?[-/ ][^\W\d_]{3,}\.?[-/ ]\d{2}|[^\W\d_]{3,9}\.? \d{1,2},? \d{4}"
)


def names_of_times(form: FileForm) -> frozenset[str]:
    """Names of time columns, in lower case except those of the column map."""
    return frozenset((*NAMES, *form.time))


def is_time(title: str, times: Collection[str]) -> bool:
    """Whether a column with this title holds times; `times` are names of such columns."""
    title = title.strip()
    plain = parts_of(title)[0].lower()
    return title in times or plain in times or plain.partition(" (")[0] in times


def are_titles(cells: Sequence[str], times: Collection[str]) -> bool:
    """Whether a row holds titles: at least two, one of a time, and no number or date."""
    return (
        sum(1 for cell in cells if cell.strip()) > 1
        and any(is_time(cell, times) for cell in cells)
        and not any(is_value(cell) for cell in cells)
    )


def left_out_above(lines: int) -> tuple[str, ...]:
    """The remark on lines above the titles, if there are any."""
    return (f"{plural(lines, 'line', 'lines')} above the titles left out",) if lines else ()


def rejoined(titles: Sequence[str], separator: str) -> list[str]:
    """Titles in which node ids that were split at their semicolon are rejoined.

    >>> rejoined(["time", "ns=2", "s=A.dp", "ns=2;s=A.n"], ";")
    ['time', 'ns=2;s=A.dp', 'ns=2;s=A.n']
    """
    found: list[str] = []
    for title in titles:
        split = separator == ";" and found and _NAMESPACE.match(found[-1])
        if split and _IDENTIFIER.match(title):
            found[-1] = f"{found[-1]};{title}"
        else:
            found.append(title)
    return found


def units_below(titles: Sequence[str], row: Sequence[str]) -> tuple[str, ...] | None:
    """Units of the columns if the row below the titles holds them, else None.

    >>> units_below(["time", "A.dp"], ["s", "[bar]"]), units_below(["time", "A.dp"], ["0", "1"])
    (('s', 'bar'), None)
    """
    width = len(titles)
    if not (is_whole(row, width) and are_units(row[:width])):
        return None
    return tuple(unit_in(cell) for cell in row[:width])


def are_values(cells: Sequence[str]) -> bool:
    """Whether a row holds readings: at least two, each a number or a date, and not only 1.

    >>> are_values(["1", "2"]), are_values(["1", "bar"]), are_values(["1", "1"])
    (True, False, False)
    """
    named = [cell.strip() for cell in cells if cell.strip()]
    sure = [cell for cell in named if is_value(cell)]
    return len(named) > 1 and bool(sure) and len(sure) + named.count("1") == len(named)


def are_units(cells: Sequence[str]) -> bool:
    """Whether the row below the titles holds units: at least two, and no number or date.

    >>> are_units(["s", "bar", "m3/h", "1"]), are_units(["0.5", "Bad", "Bad"]), are_units("111")
    (True, False, False)
    """
    named = [cell.strip() for cell in cells if cell.strip().lower() not in BLANK]
    return len(named) > 1 and {*named} != {"1"} and not any(is_value(cell) for cell in named)


def unit_in(cell: str) -> str:
    """A unit in a row of units, without its brackets.

    >>> unit_in("[bar]"), unit_in("(l/h)"), unit_in("-")
    ('bar', 'l/h', '')
    """
    text = cell.strip()
    if text.lower() in BLANK:
        return ""
    return text[1:-1].strip() if text[0] + text[-1] in ("[]", "()") else text


def is_value(cell: str) -> bool:
    """Whether a cell is a number (except 1, which is a unit) or begins like a date."""
    text = cell.strip()
    try:
        return text != "1" and float(_MARKS.sub("", text)) is not None
    except ValueError:
        return _DATE.match(text) is not None


@dataclass(frozen=True)
class TitleLine:
    """The `number` of the line of titles, from 0, its `separator`, and the number of lines `above`
    it that are not part of the table."""

    number: int
    separator: str
    above: int


class TitleSearch:
    """Searches for the first line that looks like titles and has a row at least as wide below it.
    If no line looks like titles, the first line holds them."""

    def __init__(self, times: Collection[str]) -> None:
        self._times = times
        self._found: list[TitleLine] = []
        self._likely: list[TitleLine] = []
        self._cells: list[str] = []
        self._number, self._stated = 0, ""
        self.in_sight = False
        """Whether a line so far looks like titles, or like a row of numbers."""

    def add(self, line: str) -> TitleLine | None:
        """Take in a line; gives the titles once further lines would change nothing."""
        number, self._number = self._number, self._number + 1
        stated, is_header = before_header(line)
        self._stated = stated or self._stated
        if not is_header:
            return None
        separator = self._stated or separator_of(line)
        above, cells = self._cells, cells_of(line, separator)
        values = are_values(cells)
        # Titles may be numbers, such as channels of a logger, if only numbers are below them.
        timed = values and len(above) > 1 and any(is_time(cell, self._times) for cell in above)
        last = self._found[-1] if self._found else None
        if last and len(cells) >= len(above) and (timed or last in self._likely):
            return last
        self._found.append(TitleLine(number, separator, len(self._found)))
        self._cells = cells
        if are_titles(cells, self._times):
            self._likely.append(self._found[-1])
        self.in_sight = self.in_sight or values or self._found[-1] in self._likely
        return self.so_far() if len(self._found) > limits.LINES_ABOVE_TITLES else None

    def so_far(self) -> TitleLine | None:
        """The titles if no further line comes; None without a line that may hold them."""
        last = self._found[-1:]
        sure = [line for line in last if line in self._likely]
        return next(iter(sure or self._likely or self._found), None)
