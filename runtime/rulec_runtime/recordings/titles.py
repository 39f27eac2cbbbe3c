"""Where the titles of a table are: behind lines that belong to no table, before a row of units."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from rulec_runtime.recordings.csv_table import BLANK
from rulec_runtime.recordings.header import parts_of

_DATE = re.compile(r"\d{1,4}[-./:]\d")


def is_time(title: str, times: Collection[str]) -> bool:
    """Whether a column of this title holds times; `times` are names of such columns."""
    title = title.strip()
    return title in times or parts_of(title)[0].lower() in times


def are_titles(cells: Sequence[str], times: Collection[str]) -> bool:
    """Whether a row holds titles: one is that of a time, and none is a number or a date."""
    return (
        sum(1 for cell in cells if cell.strip()) > 1
        and any(is_time(cell, times) for cell in cells)
        and not any(is_value(cell) for cell in cells)
    )


def are_units(cells: Sequence[str]) -> bool:
    """Whether the row below the titles holds units: two at least, and neither number nor date.

    >>> are_units(["s", "bar", "m3/h", "1"]), are_units(["0.5", "Bad", "Bad"])
    (True, False)
    """
    named = [cell for cell in cells if cell.strip().lower() not in BLANK]
    return len(named) > 1 and not any(is_value(cell) for cell in named)


def unit_in(cell: str) -> str:
    """A unit as it stands in a row of units, without its brackets.

    >>> unit_in("[bar]"), unit_in("(l/h)"), unit_in("-")
    ('bar', 'l/h', '')
    """
    text = cell.strip()
    if text.lower() in BLANK:
        return ""
    return text[1:-1].strip() if text[0] + text[-1] in ("[]", "()") else text


def is_value(cell: str) -> bool:
    """Whether a cell is a number (but 1, which is a unit) or begins as a date."""
    text = cell.strip()
    try:
        return text != "1" and float(text.replace(",", ".")) is not None
    except ValueError:
        return _DATE.match(text) is not None
