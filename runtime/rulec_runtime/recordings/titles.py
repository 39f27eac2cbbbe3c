"""Find the titles of a table: after lines that belong to no table, before a row of units."""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

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

_NAMESPACE = re.compile(r"\s*nsu?=[^;]*$")
_ROUND = re.compile(r"\s*(?P<name>[^][()]*[^][()\s])\s*\((?P<unit>[^][()]*)\)\s*")
_IDENTIFIER = re.compile(r"[isgb]=")
_MARKS = re.compile(r"[.,](?=\d)")
_DATE = re.compile(
    r"\d{1,4}[-./:]\d|\d{1,2}\.?[-/ ][^\W\d_]{3,}\.?[-/ ]\d{2}|[^\W\d_]{3,9}\.? \d{1,2},? \d{4}"
)


def parts_of(title: str) -> tuple[str, str]:
    """Name and unit of a column; a title in any other form is all name.

    >>> parts_of("A.dp [bar]"), parts_of("A.dp (bar)"), parts_of("A.dp"), parts_of("a[b]c")
    (('A.dp', 'bar'), ('A.dp', 'bar'), ('A.dp', ''), ('a[b]c', ''))
    """
    if round_ := _ROUND.fullmatch(title):
        return round_["name"], round_["unit"]
    name, bracket, rest = title.partition("[")
    name = name.strip()
    if not bracket and "]" not in title:
        return name, ""
    unit, closed, behind = rest.partition("]")
    if not (name and bracket and closed) or behind.strip() or set("[]") & {*name, *unit}:
        return title, ""
    return name, unit


NAMES = (
    "time", "datetime", "timestamp", "date", "t", "zeit", "zeitstempel", "datum", "uhrzeit",
    "time stamp", "time_stamp", "date time", "date/time", "timestring", "t_stamp", "_time",
    "x_value",
)  # fmt: skip
"""Names of the time column, in lower case."""

TEMPERATURE = "T"
"""Not a name of the time column: t is a time, T a temperature (ISO 80000)."""


def names_of_times(form: FileForm) -> frozenset[str]:
    """Names of time columns, in lower case except those of the column map."""
    return frozenset((*NAMES, *form.time))


def is_time(title: str, times: Collection[str] = NAMES) -> bool:
    """Whether a column with this title holds times; `times` are names of such columns.

    >>> is_time("Time [s]"), is_time("t (ms)"), is_time("T")
    (True, True, False)
    """
    name = parts_of(title.strip())[0]
    if title.strip() in times or name in times:
        return True
    return name != TEMPERATURE and name.lower() in times


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
    it that are not part of the table. It is `likely` if a line looks like titles, or like a row of
    numbers."""

    number: int
    separator: str
    above: int
    likely: bool


def title_line(
    lines: Iterable[str], times: Collection[str], ended: bool = True
) -> TitleLine | None:
    """The first line that looks like titles and has a row at least as wide below it; if no line
    looks like titles, the first one.

    None without a line that may hold titles or, unless all lines have come (`ended`), while further
    ones may change the answer. `times` are names of time columns.
    """
    found, first = list[TitleLine](), None
    stated, promising, above = "", False, list[str]()
    for number, line in enumerate(lines):
        own, is_header = before_header(line)
        stated = own or stated
        if not is_header:
            continue
        separator = stated or separator_of(line)
        cells = cells_of(line, separator)
        values = are_values(cells)
        # Titles may be numbers, such as channels of a logger, if only numbers are below them.
        timed = values and len(above) > 1 and any(is_time(cell, times) for cell in above)
        if found and len(cells) >= len(above) and (timed or found[-1].likely):
            return replace(found[-1], likely=True)
        likely = are_titles(cells, times)
        promising = promising or values or likely
        found.append(TitleLine(number, separator, len(found), likely))
        first = first or (found[-1] if likely else None)
        above = cells
        if len(found) > limits.LINES_ABOVE_TITLES:
            break
    else:
        if not (ended and found):
            return None
    best = found[-1] if found[-1].likely else first or found[0]
    return replace(best, likely=promising)
