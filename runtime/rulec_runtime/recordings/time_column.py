"""The time column of a recording: seconds in any unit of time, or dates."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import UnitSpec
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.piecewise import any_of
from rulec_runtime.recordings.reading_unit import fitting, parse_unit
from rulec_runtime.recordings.scratch import mapped
from rulec_runtime.recordings.table import Cells, Dates, texts_of
from rulec_runtime.recordings.zone import in_zone

NAMES = ("time", "datetime", "timestamp", "date", "t", "zeit")
"""Names of the time column, in lower case."""

TEMPERATURE = "T"
"""What is no name of the time column: t is a time, and T a temperature (ISO 80000)."""

_DAY_FIRST = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})")


def is_time(name: str) -> bool:
    """Does a column by its name hold times?

    >>> is_time("Time"), is_time("t"), is_time("T")
    (True, True, False)
    """
    return name.lower() in NAMES and name != TEMPERATURE


def read_times(
    path: Path,
    cells: Cells,
    title: str,
    unit: str,
    units: Mapping[str, UnitSpec],
    zone: str = "",
    notes: list[str] | None = None,
) -> tuple[Array, Array | None]:
    """Seconds, NaN where there is no time; second, where they are dates (since 1970): their zones
    as seconds ahead of UTC, NaN where a date names none.

    `zone` is the name of the zone of dates that name none; what is odd in it goes to `notes`.
    """
    if not isinstance(cells, Dates):
        numbers = cells if isinstance(cells, np.ndarray) else plain_times(cells)
        if any_of(numbers):
            factor = factor_of_time(path, title, unit, units)
            return mapped(numbers, lambda part: part * factor), None
        texts = texts_of(cells)
        cells = Dates(*dates_of(texts))
    else:
        texts = []
    dates, zones = cells.seconds, cells.zones
    if not any_of(dates):
        shown = f"'{texts[0].strip()[:30]}'" if texts else "no date"
        raise RecordingRefused(
            f"{path}: the time column '{title}' holds {shown}; expected seconds, "
            "or dates such as 2025-03-31 14:05:00 or 31.03.2025 14:05:00"
        )
    if zone and any_of(zones, np.isnan):
        return in_zone(path, dates, zones, zone, [] if notes is None else notes)
    return dates, zones


def dates_of(cells: Sequence[str]) -> tuple[Array, Array]:
    """Seconds since 1970, NaN where a cell is no date, and seconds ahead of UTC as far as told."""
    table = np.array([_date(cell) for cell in cells]).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def plain_times(cells: Sequence[str]) -> Array:
    """Cells as numbers, NaN where they are none."""
    try:
        return np.array(cells, dtype=float)
    except ValueError:
        pass
    result = np.full(len(cells), np.nan)
    for i, cell in enumerate(cells):
        try:
            result[i] = float(cell.replace(",", "."))
        except ValueError:
            continue
    return result


def factor_of_time(path: Path, title: str, text: str, units: Mapping[str, UnitSpec]) -> float:
    """Seconds per unit of the time column."""
    unit, second = parse_unit(text or "s", units), units["s"]
    if unit is None or unit.dimension != second.dimension:
        known = ", ".join(fitting(second, units))
        raise RecordingRefused(
            f"{path}: the time column '{title}' is in '{text[:40]}'; expected {known}, or dates"
        )
    return unit.factor


def _date(cell: str) -> tuple[float, float]:
    """Seconds since 1970, and the zone's seconds ahead of UTC, NaN without one.

    A date without a zone counts as UTC, so no hour is lost or doubled.
    """
    text = cell.strip()
    day_first = _DAY_FIRST.match(text)
    if day_first:
        day, month, year = day_first.groups()
        text = f"{year}-{month:0>2}-{day:0>2}" + text[day_first.end() :]
    try:
        date = datetime.fromisoformat(text)
        zone = date.utcoffset()
        date = date if date.tzinfo else date.replace(tzinfo=UTC)
        seconds = date.astimezone(UTC).timestamp()
    except (ValueError, OverflowError):  # no date, or in UTC one that no calendar has
        return float("nan"), float("nan")
    return seconds, float("nan") if zone is None else zone.total_seconds()
