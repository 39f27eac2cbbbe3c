"""Read the time of a recording: numbers in any unit of time, which may count from a date, or dates,
in one column or several."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.file_form import INFERRED, START, FileForm, Order
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import UnitSpec
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import RecordingRefused, Unclear, numbers_in
from rulec_runtime.recordings.dates import (
    date_of,
    dates_of,
    in_zone,
    orders_of,
    time_of_day,
)
from rulec_runtime.recordings.larger_than_memory import copied
from rulec_runtime.recordings.reading_unit import fitting, parse_unit
from rulec_runtime.recordings.table import Cells, Dates, texts_of


@dataclass(frozen=True)
class Counting:
    """Numbers that count a `unit` of `factor` seconds from a date, which ends in Z if in UTC."""

    unit: str
    factor: float
    since: str

    @property
    def start(self) -> float:
        """The date in s since 1970, taken as UTC if it names no zone."""
        date = datetime.fromisoformat(self.since)
        return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()

    def numbers(self, year: int) -> float:
        """The number at the beginning of a year."""
        return (datetime(year, 1, 1, tzinfo=UTC).timestamp() - self.start) / self.factor


UNIX = "1970-01-01T00:00:00Z"
SPREADSHEET = Counting("d", 86400.0, "1899-12-30")

COUNTINGS = (
    Counting("s", 1.0, UNIX),
    Counting("ms", 1e-3, UNIX),
    Counting("us", 1e-6, UNIX),
    Counting("ns", 1e-9, UNIX),
    Counting("s", 1.0, "1904-01-01T00:00:00Z"),  # LabVIEW
    Counting("100 ns", 1e-7, "1601-01-01T00:00:00Z"),  # Windows
    Counting("100 ns", 1e-7, "0001-01-01"),  # .NET
)
"""No number is a date of this century in two of them."""


def may_be_day(number: float) -> bool:
    """Whether a number may be a day of a spreadsheet in this century: two rows show if it is."""
    first, last = map(SPREADSHEET.numbers, (limits.FIRST_YEAR, limits.LAST_YEAR))
    return first <= number < last


def counting_of(
    path: Path, numbers: Array, title: str, factor: float, form: FileForm, notes: list[str]
) -> Counting | None:
    """How numbers count from a date; None if they count from a zero of their own.

    `factor` is the unit that title or file name, s, or 0. Raises `Unclear` if both are possible.
    """
    if form.since == START:
        return None
    if form.since:
        return Counting("", form.time_factor or factor or 1.0, form.since)
    finite, first = numbers[np.isfinite(numbers)], numbers[: limits.FIRST_STEPS]
    low, high = float(finite.min(initial=np.inf)), float(finite.max(initial=-np.inf))
    steps = np.diff(first[np.isfinite(first)])
    step = float(np.median(steps)) if len(steps) else 0.0
    for one in COUNTINGS:
        if one.numbers(limits.FIRST_YEAR) <= low and high < one.numbers(limits.LAST_YEAR):
            if factor and not np.isclose(factor, one.factor):
                raise _which(path, title, low, one)
            notes.append(f"times count {one.unit} since {one.since[:10]}")
            return one
    days = SPREADSHEET
    if not (may_be_day(low) and may_be_day(high)):
        return None
    if factor == SPREADSHEET.factor or (not factor and 0 < step < limits.BRIEFEST_ROW):
        notes.append(f"times are days of a spreadsheet, since {days.since}")
        return days
    if not factor and 0 < step < limits.LONGEST_OF_SECONDS:
        raise _which(path, title, low, days)
    return None


def dated(numbers: Array, one: Counting) -> Dates:
    """The dates that numbers count."""
    start, zone = one.start, 0.0 if one.since.endswith("Z") else np.nan
    seconds = copied(np.round(numbers * one.factor, 6) + start)
    return Dates(seconds, np.broadcast_to(np.full(1, zone), len(numbers)))


def _which(path: Path, title: str, low: float, one: Counting) -> Unclear:
    return Unclear(
        f"{path}: '{title}' begins with {low:.15g}, which may count {one.unit} since "
        f"{one.since[:10]} or be a time from a zero of its own; say which in the column map, as in "
        f"'time: {{from: \"{title}\", unit: {one.unit}, since: {one.since}}}' or 'since: start'",
        [{"since": one.since, "time_factor": one.factor}, {"since": START}],
        likely=False,
    )


class TimeReader:
    """Times of a column, all at once or block by block, as numbers or dates.

    The first cells with a usable time decide how all are written: as dates (`dated`, None before),
    in which `order` of day, month and year, or as numbers, if most are, `counting` from a date or
    not. Remarks on that go to `notes`. `factor` gives the unit that title or file name, s, or 0.
    """

    def __init__(
        self,
        path: Path,
        form: FileForm,
        notes: list[str],
        title: str = "time",
        factor: Callable[[], float] = lambda: 0.0,
    ) -> None:
        self._path, self._form, self._notes = path, form, notes
        self._title, self._factor = title, factor
        self.dated: bool | None = None
        self.order: Order = ""
        self.counting: Counting | None = None

    def read(self, cells: Cells) -> Array | Dates:
        """Dates, or numbers that count from a zero of their own; NaN where there is no time. Raises
        `Unclear` if the first cells can be read in several ways."""
        if isinstance(cells, Dates):
            self.dated = True
            return cells
        if not self.dated or self.counting is not None:
            numbers = cells if isinstance(cells, np.ndarray) else plain_times(cells)
            if self.dated is None and _are_digits_of_dates(numbers):
                self.dated = True
            elif self.dated is None and _most(numbers, cells):
                self.counting = counting_of(
                    self._path, numbers, self._title, self._factor(), self._form, self._notes
                )
                self.dated = self.counting is not None
            if self.counting is not None:
                return dated(numbers, self.counting)
            if self.dated is False:
                return numbers
        texts = texts_of(cells)
        if self.dated is None:
            self.order = order_in(self._path, lambda: texts, self._form, self._notes)
        dates = Dates(*dates_of(texts, self.order))
        self.dated = self.dated or bool(np.isfinite(dates.seconds).any()) or None
        return dates


def _are_digits_of_dates(numbers: Array) -> bool:
    """Whether numbers are dates and times of this century in digits alone, 20250331140500: as
    seconds from a zero of their own they would be 600 000 years."""
    known = numbers[np.isfinite(numbers)]
    first, last = (1e10 * year for year in (limits.FIRST_YEAR, limits.LAST_YEAR))
    return len(known) > 0 and bool((known >= first).all() and (known < last).all())


def _most(numbers: Array, cells: Cells) -> bool:
    """Whether most cells that hold anything hold a number: a 0 or 1899 among dates decides
    nothing."""
    count = int(np.isfinite(numbers).sum())
    return count > 0 and (count == len(numbers) or 2 * count > sum(map(bool, texts_of(cells))))


def read_times(
    path: Path,
    cells: Cells,
    title: str,
    unit: str,
    units: Mapping[str, UnitSpec],
    zone: str = "",
    notes: list[str] | None = None,
    form: FileForm = INFERRED,
) -> tuple[Array, Array | None]:
    """Seconds, NaN where there is no time; second, for dates (since 1970), their zones as seconds
    ahead of UTC, NaN where a date names none.

    `zone` is the name of the zone of dates that name none; remarks go to `notes`.
    """
    notes = [] if notes is None else notes
    own = list[str]()

    def factor() -> float:
        return form.time_factor or factor_of_time(path, title, unit, units)

    times = TimeReader(path, form, own, title, lambda: factor() if unit else 0.0).read(cells)
    notes += (f"{path.name}: {one}" for one in own)
    if not isinstance(times, Dates):
        return copied(times * factor()), None
    dates, zones = times.seconds, times.zones
    if not np.isfinite(dates).any():
        texts = [] if isinstance(cells, Dates) else texts_of(cells)
        shown = f"'{texts[0].strip()[:30]}'" if texts else "no date"
        raise RecordingRefused(
            f"{path}: the time column '{title}' holds {shown}; expected seconds, "
            "or dates such as 2025-03-31 14:05:00 or 31.03.2025 14:05:00"
        )
    if zone and np.isnan(zones).any():
        return in_zone(path, dates, zones, zone, notes)
    return dates, zones


def order_in(
    path: Path, cells: Callable[[], Iterable[str]], form: FileForm, notes: list[str]
) -> Order:
    """The order of day, month and year in a column of times; an inferred one goes to `notes`.
    Raises `Unclear` if several orders are possible."""
    if form.dates:
        return form.dates
    date, orders = orders_of(islice(cells(), common.SHOWING_ROWS))
    if len(orders) > 1:
        date, orders = orders_of(cells())
    if len(orders) > 1:
        days = (datetime.fromtimestamp(date_of(date, order)[0], UTC) for order in orders)
        read = " or ".join(f"{d:%-d %B %Y} ({o})" for d, o in zip(days, orders, strict=True))
        raise Unclear(
            f"{path}: the date '{date[:30]}' may be {read}; say which in the column map, as in "
            f"'time: {{from: ..., dates: {orders[0]}}}'",
            [{"dates": order} for order in orders],
            likely=False,
        )
    if not orders:
        return ""
    notes.append(f"dates are read with the {orders[0].removesuffix(' first')} first")
    return orders[0]


def plain_times(cells: Sequence[str]) -> Array:
    """Cells as numbers, perhaps with a decimal comma, NaN for others."""
    return numbers_in([cell.replace(",", ".") for cell in cells])[0]


def factor_of_time(path: Path, title: str, text: str, units: Mapping[str, UnitSpec]) -> float:
    """Seconds per unit of the time column."""
    unit, second = parse_unit(text or "s", units), units["s"]
    if unit is None or unit.dimension != second.dimension:
        allowed = ", ".join(fitting(second, units))
        raise RecordingRefused(
            f"{path}: the time column '{title}' is in '{text[:40]}'; expected {allowed}, or dates"
        )
    return unit.factor


def time_of_parts(
    path: Path, parts: Sequence[Cells], form: FileForm, remarks: tuple[str, ...] = ()
) -> tuple[Cells, tuple[str, ...]]:
    """A column of times from its parts, as numbers or dates, and the remarks on it. Raises
    `Unclear` as `order_in` does."""
    notes = list(remarks)
    first = TimeReader(path, form, notes).read(parts[0])
    if len(parts) < 2 or not isinstance(first, Dates):
        return first, tuple(notes)
    texts = texts_of(parts[1])
    clock = plain_times(texts)
    if not np.isfinite(clock).any():
        times = {cell: time_of_day(cell) for cell in {*texts}}
        clock = np.array([times[cell] for cell in texts])
    elif np.nanmax(clock) < 1:  # shares of a day, as in spreadsheets
        clock = clock * SPREADSHEET.factor
    midnights = first.seconds[np.isfinite(first.seconds)] % SPREADSHEET.factor == 0
    if not np.isfinite(clock).any() or not midnights.all():
        return first, tuple(notes)  # the date includes the time of day
    seconds = first.seconds + clock
    if len(parts) > 2:
        seconds = seconds + np.nan_to_num(plain_times(texts_of(parts[2]))) / 1000
    notes.append(f"the time is made of {len(parts)} columns")
    return Dates(seconds, first.zones), tuple(notes)


def seconds_in(times: Cells, form: FileForm) -> Array:
    """Times from a `TimeReader` in s."""
    if isinstance(times, Dates):
        return times.seconds
    return np.asarray(times, dtype=float) * (form.time_factor or 1.0)
