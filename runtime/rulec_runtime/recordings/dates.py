"""Read dates as programs write them: any order of day, month and year, names of months, AM and PM.

Dates without a zone may be of a plant whose zone is known by name, such as Europe/Berlin.
"""

import math
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from functools import lru_cache
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.file_form import Order
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import RecordingRefused

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

_ORDERS: dict[Order, tuple[int, int, int]] = {
    "day first": (2, 1, 0),
    "month first": (2, 0, 1),
    "year first": (0, 1, 2),
}
"""Order of year, month and day in a date."""

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


_COMPACT = re.compile(r"(?P<day>\d{8})(?P<time>\d{6})(?P<part>\.\d{1,9})?")


def orders_of(cells: Iterable[str]) -> tuple[str, tuple[Order, ...]]:
    """The first of some cells whose form does not fix the order of day, month and year, and the
    orders in which all of them can be read. The form fixes it if they name months, begin with a
    year of four digits, or have dots, which put the day first.

    >>> orders_of(["3/31/2025 02:05 PM"]), orders_of(["2025-03-31"]), orders_of(["31-Mar-25"])
    (('3/31/2025 02:05 PM', ('month first',)), ('', ()), ('', ()))
    >>> orders_of(["3/4/2025"])
    ('3/4/2025', ('day first', 'month first'))
    """
    left = tuple(_ORDERS)
    first = ""
    for cell in cells:
        orders = _orders(cell.strip())
        if orders:
            first = first or cell.strip()
            left = tuple(order for order in left if order in orders) or left
            if len(left) == 1:
                break
    return first, left if first else ()


@lru_cache(maxsize=1024)
def _orders(text: str) -> tuple[Order, ...]:
    """Orders in which a date can be read; empty if its form leaves no choice."""
    match = _DATE.fullmatch(text[: limits.LONGEST_DATE + 1])
    if match is None or match["sign"] in ". ":
        return ()
    parts = match["first"], match["second"], match["third"]
    if not all(part.isdigit() for part in parts) or len(parts[0]) > 2:
        return ()
    # No date lies in the future: otherwise a day of two digits could pass for a year.
    latest = datetime.now(UTC).year + 1
    return tuple(
        order
        for order, (y, m, d) in _ORDERS.items()
        if _year(parts[y]) <= latest and int(parts[m]) <= 12 and int(parts[d]) <= 31
    )


def dates_of(cells: Sequence[str], order: Order) -> tuple[Array, Array]:
    """Seconds since 1970, NaN where a cell is no date, and seconds ahead of UTC, NaN if unknown.

    A date without a zone counts as UTC, so no hour is lost or doubled.
    """
    dates = {cell: date_of(cell, order) for cell in {*cells}}  # a long table repeats them
    table = np.array([dates[cell] for cell in cells]).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def date_of(cell: str, order: Order = "") -> tuple[float, float]:
    """As `dates_of`, for one cell."""
    text = cell.strip()
    if len(text) > limits.LONGEST_DATE:
        return (math.nan, math.nan)
    if compact := _COMPACT.fullmatch(text):
        text = f"{compact['day']}T{compact['time']}{compact['part'] or ''}"
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
        order = "year first"
    elif not first.isdigit():
        order = "month first"
    elif not second.isdigit() or (not order and sign == "."):
        order = "day first"
    y, m, d = ((first, second, third)[i] for i in _ORDERS[order])
    return _year(y), _month(m), int(d)


def _year(text: str) -> int:
    century = (1900 if int(text) >= limits.LAST_CENTURY else 2000) if len(text) < 4 else 0
    return century + int(text)


def _month(text: str) -> int:
    name = text.lower()
    return int(text) if text.isdigit() else _MONTHS.get(name[:4]) or _MONTHS[name[:3]]


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
    clock = clock.replace(microsecond=int(part))
    zone = match["zone"]
    if zone is None:
        return clock
    if zone[0] not in "+-":
        return clock.replace(tzinfo=timezone(timedelta(minutes=_ZONES[zone])))
    ahead = timedelta(hours=int(zone[1:3]), minutes=int(zone[-2:]))
    return clock.replace(tzinfo=timezone(-ahead if zone[0] == "-" else ahead))


def _seconds(date: datetime) -> tuple[float, float]:
    zone = date.utcoffset()
    date = date if date.tzinfo else date.replace(tzinfo=UTC)
    seconds = date.astimezone(UTC).timestamp()
    return seconds, float("nan") if zone is None else zone.total_seconds()


_STEP = 900.0
"""Zones change at whole quarters of an hour."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)

_ANOTHER_HOUR = 2 * 3600.0
"""Seconds after which a repeated hour is that of another year."""


def in_zone(
    path: Path, dates: Array, zones: Array, zone: str, notes: list[str]
) -> tuple[Array, Array]:
    """Seconds since 1970 in UTC, and seconds ahead of UTC, of dates in the order of their rows.

    `dates`, shape (n,), are local where `zones` is NaN.
    """
    clock = ZoneClock(path, zone)
    utc, ahead = clock.read(dates, zones)
    if clock.twice and not clock.again:
        count = plural(clock.twice, "row is", "rows are")
        notes.append(
            f"{path.name}: {count} in the hour that {zone} shows twice, and nothing says which is "
            "meant; the first is taken"
        )
    if clock.never:
        notes.append(f"{path.name}: {clock.left_out()}")
    return utc, ahead


class ZoneClock:
    """Dates of a zone, block by block in the order of their rows.

    In the repeated hour at the end of summer time, dates after a step back belong to the second
    pass. `twice` counts rows in such hours, `again` those of the second pass, `never` rows in hours
    that the zone skips.
    """

    def __init__(self, path: Path, zone: str) -> None:
        self._clock, self._zone = _clock(path, zone), zone
        self._wall, self._second = -np.inf, False
        self.twice = self.again = self.never = 0

    def resume(self, utc: float) -> None:
        """Continue after a date that was read before, s since 1970."""
        with suppress(OverflowError):  # beyond the end of the calendar
            (ahead,) = ahead_of_utc(self._clock, np.array([utc]))
            wall = np.array([utc + ahead])
            first, second = (ahead_of_utc(self._clock, wall, fold)[0] for fold in (0, 1))
            if first > second:
                self._wall, self._second = float(wall[0]), bool(ahead == second)

    def read(self, dates: Array, zones: Array) -> tuple[Array, Array]:
        """As `in_zone`, for further dates."""
        bare = np.isnan(zones) & np.isfinite(dates)
        wall = np.where(bare, dates, 0.0)
        first, second = (ahead_of_utc(self._clock, wall, fold) for fold in (0, 1))
        self.never += int((bare & (first < second)).sum())
        twice = np.flatnonzero(bare & (first > second))
        again = twice[self._behind_a_step_back(wall[twice])]
        self.twice, self.again = self.twice + len(twice), self.again + len(again)
        ahead = first.copy()
        ahead[again] = second[again]
        return np.where(bare, wall - ahead, dates), np.where(bare, ahead, zones)

    def left_out(self) -> str:
        """The remark on rows in skipped hours."""
        count = plural(self.never, "row is", "rows are")
        return f"{count} in the hour that {self._zone} leaves out; is the zone right?"

    def _behind_a_step_back(self, wall: Array) -> NDArray[np.bool_]:
        """Which dates of repeated hours are of the second pass, shape (n,)."""
        found = np.zeros(len(wall), dtype=bool)
        for k, date in enumerate(wall.tolist()):
            same_hour = date - self._wall <= _ANOTHER_HOUR
            self._second = same_hour and (self._second or date < self._wall)
            self._wall, found[k] = date, self._second
        return found


def _clock(path: Path, zone: str) -> ZoneInfo:
    try:
        return ZoneInfo(zone)
    except (ValueError, OSError, KeyError):
        raise RecordingRefused(
            f"{path}: this machine does not know the time zone '{zone[:40]}' that the plant's "
            "column map names; 'pip install tzdata' brings all zones"
        ) from None


def ahead_of_utc(zone: tzinfo, seconds: Array, fold: int | None = None) -> Array:
    """Seconds that a zone is ahead of UTC at times, shape (n,), s since 1970; NaN for NaN.

    With a `fold` the times are those that the zone's clocks show, in the first (0) or the second
    (1) pass of a repeated hour.
    """
    quarters, which = np.unique(np.floor(seconds / _STEP), return_inverse=True)
    found = []
    for start in (quarters * _STEP).tolist():
        date = None if math.isnan(start) else _EPOCH + timedelta(seconds=start)
        if date is not None and fold is not None:
            date = date.replace(tzinfo=zone, fold=fold)
        offset = None if date is None else date.astimezone(zone).utcoffset()
        found.append(math.nan if offset is None else offset.total_seconds())
    return np.array(found, dtype=float)[which]
