"""Times that count from a date, such as Unix time and days of a spreadsheet."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from rulec_runtime.contract.file_form import START, FileForm
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import Unclear
from rulec_runtime.recordings.larger_than_memory import blocks, mapped
from rulec_runtime.recordings.table import Dates


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
    low, high, step = _ends(numbers)
    for one in COUNTINGS:
        if one.numbers(limits.FIRST_YEAR) <= low and high < one.numbers(limits.LAST_YEAR):
            if factor and not np.isclose(factor, one.factor):
                raise _which(path, title, low, one)
            notes.append(f"times count {one.unit} since {one.since[:10]}")
            return one
    days = SPREADSHEET
    if not (days.numbers(limits.FIRST_YEAR) <= low and high < days.numbers(limits.LAST_YEAR)):
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
    seconds = mapped(numbers, lambda part: np.round(part * one.factor, 6) + start)
    return Dates(seconds, np.broadcast_to(np.full(1, zone), len(numbers)))


def _ends(numbers: Array) -> tuple[float, float, float]:
    """Smallest and largest number, and the median step of the first block."""
    low, high = np.inf, -np.inf
    for a, b in blocks(len(numbers), numbers):
        part = numbers[a:b][np.isfinite(numbers[a:b])]
        low, high = min(low, part.min(initial=np.inf)), max(high, part.max(initial=-np.inf))
    first = numbers[: limits.BLOCK]
    steps = np.diff(first[np.isfinite(first)])
    return float(low), float(high), float(np.median(steps)) if len(steps) else 0.0


def _which(path: Path, title: str, low: float, one: Counting) -> Unclear:
    return Unclear(
        f"{path}: '{title}' begins with {low:.15g}, which may count {one.unit} since "
        f"{one.since[:10]} or be a time from a zero of its own; say which in the column map, as in "
        f"'time: {{from: \"{title}\", unit: {one.unit}, since: {one.since}}}' or 'since: start'",
        [{"since": one.since, "time_factor": one.factor}, {"since": START}],
        likely=False,
    )
