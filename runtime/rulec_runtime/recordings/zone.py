"""Dates without a zone, of a plant whose zone has a name, as Europe/Berlin."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.scratch import arrays, blocks, let_go

_NONE = np.zeros(0, dtype=np.intp)

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
    utc, ahead = arrays([((len(dates),), float)] * 2)
    never, rows, walls, later = 0, [_NONE], [np.zeros(0)], [np.zeros(0)]
    for low, high in blocks(len(dates)):
        here, own = dates[low:high], zones[low:high]
        bare = np.isnan(own) & np.isfinite(here)
        wall = np.where(bare, here, 0.0)
        quarters, which = np.unique(np.floor(wall / _STEP), return_inverse=True)
        first, second = (
            np.array([_offset(clock, quarter * _STEP, f) for quarter in quarters.tolist()])[which]
            for f in (0, 1)
        )
        utc[low:high] = np.where(bare, here - first, here)
        ahead[low:high] = np.where(bare, first, own)
        never += int((bare & (first < second)).sum())
        twice = np.flatnonzero(bare & (first > second))
        rows.append(twice + low)
        walls.append(wall[twice])
        later.append(second[twice])
        let_go(dates, zones, utc, ahead)
    again = _behind_a_step_back(np.concatenate(walls))
    at, offset = np.concatenate(rows)[again], np.concatenate(later)[again]
    utc[at], ahead[at] = np.concatenate(walls)[again] - offset, offset
    ambiguous = len(again)
    if ambiguous and not again.any():
        count = plural(ambiguous, "row is", "rows are")
        notes.append(
            f"{path.name}: {count} in the hour that {zone} shows twice, and nothing says which is "
            "meant; the first is taken"
        )
    if never:
        count = plural(never, "row is", "rows are")
        notes.append(f"{path.name}: {count} in the hour that {zone} leaves out; is the zone right?")
    return utc, ahead


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


def _behind_a_step_back(wall: Array) -> np.ndarray:
    """Which dates of hours that are shown twice are of the second time, shape (n,)."""
    if not len(wall):
        return np.zeros(0, dtype=bool)
    new = np.concatenate([[True], np.diff(wall) > 2 * 3600.0])
    back = np.cumsum(np.concatenate([[False], np.diff(wall) < 0]))
    start = np.maximum.accumulate(np.where(new, np.arange(len(wall)), 0))
    found: np.ndarray = back > back[start]
    return found
