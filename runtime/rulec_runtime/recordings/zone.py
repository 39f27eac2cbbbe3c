"""Dates without a zone, of a plant whose zone has a name, as Europe/Berlin."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.csv_table import RecordingRefused

_STEP = 900.0
"""Zones change at whole quarters of an hour."""


def in_zone(
    path: Path, dates: Array, zones: Array, zone: str, notes: list[str]
) -> tuple[Array, Array]:
    """Seconds since 1970 in UTC, and seconds ahead of it, of dates in the order of their rows.

    `dates`, shape (n,), are as written where `zones` is NaN. In the hour that is shown twice at the
    end of summer time, dates behind a step back are the second ones.
    """
    clock = _clock(path, zone)
    bare = np.isnan(zones) & np.isfinite(dates)
    wall = np.where(bare, dates, 0.0)
    quarters, which = np.unique(np.floor(wall / _STEP), return_inverse=True)
    first, second = (
        np.array([_offset(clock, quarter * _STEP, fold) for quarter in quarters.tolist()])[which]
        for fold in (0, 1)
    )
    twice, never = bare & (first > second), bare & (first < second)
    again = _behind_a_step_back(wall, twice)
    offset = np.where(again, second, first)
    if twice.any() and not again.any():
        count = plural(int(twice.sum()), "row is", "rows are")
        notes.append(
            f"{path.name}: {count} in the hour that {zone} shows twice, and nothing says which is "
            "meant; the first is taken"
        )
    if never.any():
        count = plural(int(never.sum()), "row is", "rows are")
        notes.append(f"{path.name}: {count} in the hour that {zone} leaves out; is the zone right?")
    return np.where(bare, dates - offset, dates), np.where(bare, offset, zones)


def _clock(path: Path, zone: str) -> ZoneInfo:
    try:
        return ZoneInfo(zone)
    except (ValueError, OSError, KeyError):
        raise RecordingRefused(
            f"{path}: this machine does not know the time zone '{zone[:40]}' that the plant's "
            "column map names; 'pip install tzdata' brings all zones"
        ) from None


def offset_of(clock: ZoneInfo, utc: float) -> float:
    """Seconds that a zone is ahead of UTC at a time, s since 1970."""
    date = datetime.fromtimestamp(0, UTC) + timedelta(seconds=utc)
    return _seconds(date.astimezone(clock).utcoffset())


def _offset(clock: ZoneInfo, wall: float, fold: int) -> float:
    date = datetime(1970, 1, 1) + timedelta(seconds=wall)
    return _seconds(date.replace(tzinfo=clock, fold=fold).utcoffset())


def _seconds(offset: timedelta | None) -> float:
    return 0.0 if offset is None else offset.total_seconds()


def _behind_a_step_back(wall: Array, twice: np.ndarray) -> np.ndarray:
    """Which dates of the hour that is shown twice are of the second time, shape (n,)."""
    rows = np.flatnonzero(twice)
    found = np.zeros(len(wall), dtype=bool)
    if len(rows):
        new = np.concatenate([[True], np.diff(wall[rows]) > 2 * 3600.0])
        back = np.cumsum(np.concatenate([[False], np.diff(wall[rows]) < 0]))
        start = np.maximum.accumulate(np.where(new, np.arange(len(rows)), 0))
        found[rows] = back > back[start]
    return found
