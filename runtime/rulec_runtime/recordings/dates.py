"""Read dates as programs write them: any order of day, month and year, names of months, AM and
PM."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from functools import lru_cache

import numpy as np

from rulec_runtime.contract.file_form import Order
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings import limits

_MONTHS = {
    name: number
    for number, names in enumerate(
        (
            "jan ene gen",
            "feb fev fév",
            "mar mär mrz mrt maa",
            "apr abr avr",
            "may mai mag mei",
            "jun juin giu",
            "jul juil lug",
            "aug ago aoû aou",
            "sep set",
            "oct okt ott out",
            "nov",
            "dec dez dic déc",
        ),
        1,
    )
    for name in names.split()
}
"""Beginnings of months in English, German, French, Spanish, Italian, Portuguese and Dutch."""

_ZONES = {"Z": 0, "UTC": 0, "GMT": 0, "CET": 60, "MEZ": 60, "CEST": 120, "MESZ": 120}
"""Minutes ahead of UTC of zones with unambiguous names."""

_DATE = re.compile(
    r"(?:[^\W\d_]{2,9}\.?,?\s+)?"
    r"(?P<first>\d{1,4}|[^\W\d_]{3,9})\.?(?P<sign>[-/. ])\s?"
    r"(?P<second>\d{1,2}|[^\W\d_]{3,9})\.?(?:[-/. ]|,)\s?"
    r"(?P<third>\d{4}|\d{1,2})(?P<time>\D.*)?",
    re.DOTALL,
)
_TIME = re.compile(
    r"[T,@\s]*(?P<hour>\d{1,2})[:.](?P<minute>\d{2})"
    r"(?:[:.](?P<second>\d{2})(?:[.,:](?P<part>\d{1,9}))?)?"
    r"\s*(?P<half>[AaPp]\.?\s?[Mm]\.?)?\s*(?P<zone>[A-Z]{1,4}|[+-]\d{2}:?\d{2})?"
)


@dataclass(frozen=True)
class Ambiguous:
    """The first date that can be read in several `orders`."""

    date: str
    orders: tuple[Order, ...]


def order_of(cells: Iterable[str]) -> Order | Ambiguous:
    """The order in which all dates among some cells can be read; empty if their form fixes it: they
    name months, begin with a year of four digits, or have dots, which put the day first.

    >>> order_of(["3/31/2025 02:05 PM"]), order_of(["2025-03-31"]), order_of(["31-Mar-25"])
    ('month first', '', '')
    >>> order_of(["3/4/2025"])
    Ambiguous(date='3/4/2025', orders=('day first', 'month first'))
    """
    left: tuple[Order, ...] = ("day first", "month first", "year first")
    first = ""
    for cell in cells:
        orders = _orders(cell.strip())
        if orders:
            first = first or cell.strip()
            left = tuple(order for order in left if order in orders) or left
            if len(left) == 1:
                return left[0]
    return Ambiguous(first, left) if first else ""


@lru_cache(maxsize=1024)
def _orders(text: str) -> tuple[Order, ...]:
    """Orders in which a date can be read; empty if its form leaves no choice."""
    match = _DATE.fullmatch(text[: limits.LONGEST_DATE + 1])
    if match is None or match["sign"] in ". ":
        return ()
    parts = match["first"], match["second"], match["third"]
    if not all(part.isdigit() for part in parts) or len(parts[0]) > 2:
        return ()
    a, b, c = map(int, parts)
    short = len(parts[2]) < 4
    # No date lies in the future: otherwise a day of two digits could pass for a year.
    latest = datetime.now(UTC).year + 1
    found: list[Order] = []
    if _year(c, short) <= latest:
        found += ["day first"] if b <= 12 and a <= 31 else []
        found += ["month first"] if a <= 12 and b <= 31 else []
    if short and b <= 12 and c <= 31 and _year(a, True) <= latest:
        found.append("year first")
    return tuple(found)


def dates_of(cells: Sequence[str], order: Order) -> tuple[Array, Array]:
    """Seconds since 1970, NaN where a cell is no date, and seconds ahead of UTC, NaN if unknown.

    A date without a zone counts as UTC, so no hour is lost or doubled.
    """
    known = {cell: date_of(cell, order) for cell in {*cells}}  # a long table repeats them
    table = np.array([known[cell] for cell in cells]).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def date_of(cell: str, order: Order = "") -> tuple[float, float]:
    """As `dates_of`, for one cell."""
    text = cell.strip()
    if len(text) > limits.LONGEST_DATE:
        return (math.nan, math.nan)
    try:
        return _seconds(datetime.fromisoformat(text))
    except (ValueError, OverflowError):  # no date, or beyond the calendar in UTC
        pass
    match = _DATE.fullmatch(text)
    if match is None:
        return (math.nan, math.nan)
    try:
        day = datetime(*_day(match["first"], match["second"], match["third"], match["sign"], order))
        return _seconds(_at(day, match["time"] or ""))
    except (ValueError, OverflowError, KeyError):
        return (math.nan, math.nan)


def time_of_day(cell: str) -> float:
    """Seconds since midnight of a time of day, NaN if a cell holds none.

    >>> time_of_day("14:05:00"), time_of_day("2:05 PM")
    (50700.0, 50700.0)
    """
    try:
        clock = _at(datetime(1970, 1, 1), cell.strip()[: limits.LONGEST_DATE + 1])
    except (ValueError, KeyError):
        return float("nan")
    return clock.replace(tzinfo=UTC).timestamp()


@lru_cache(maxsize=1024)
def _day(first: str, second: str, third: str, sign: str, order: Order) -> tuple[int, int, int]:
    """Year, month and day. Raises `ValueError` or `KeyError` if they are invalid."""
    if len(first) == 4 and first.isdigit():
        return int(first), _month(second), int(third)
    year = _year(int(third), len(third) < 4)
    if not first.isdigit():
        return year, _month(first), int(second)
    if not second.isdigit() or order == "day first" or (not order and sign == "."):
        return year, _month(second), int(first)
    if order == "month first":
        return year, _month(first), int(second)
    if order == "year first":
        return _year(int(first), True), _month(second), int(third)
    raise ValueError(order)


def _year(number: int, short: bool) -> int:
    return number + (1900 if number >= limits.LAST_CENTURY else 2000) if short else number


def _month(text: str) -> int:
    if text.isdigit():
        return int(text)
    name = text.lower()
    return _MONTHS[name[:4] if name[:4] in _MONTHS else name[:3]]


def _at(day: datetime, text: str) -> datetime:
    """A day with the time of day in a text. Raises `ValueError` or `KeyError` if it is invalid."""
    if not text.strip():
        return day
    match = _TIME.fullmatch(text)
    if match is None:
        raise ValueError(text)
    hour = int(match["hour"])
    if match["half"]:
        if not 1 <= hour <= 12:
            raise ValueError(text)
        hour = hour % 12 + (12 if match["half"][0] in "pP" else 0)
    part = f"{match['part'] or '':0<6}"[:6]
    clock = day.replace(hour=hour, minute=int(match["minute"]), second=int(match["second"] or 0))
    return clock.replace(microsecond=int(part), tzinfo=_zone(match["zone"]))


def _zone(text: str | None) -> timezone | None:
    if text is None:
        return None
    if text in _ZONES:
        return timezone(timedelta(minutes=_ZONES[text]))
    ahead = timedelta(hours=int(text[1:3]), minutes=int(text[-2:]))
    return timezone(-ahead if text[0] == "-" else ahead)


def _seconds(date: datetime) -> tuple[float, float]:
    zone = date.utcoffset()
    date = date if date.tzinfo else date.replace(tzinfo=UTC)
    seconds = date.astimezone(UTC).timestamp()
    return seconds, float("nan") if zone is None else zone.total_seconds()
