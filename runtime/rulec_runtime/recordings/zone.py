"""Dates without a zone, of a plant whose zone is known by name, such as Europe/Berlin."""

from __future__ import annotations

from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.plan import Array
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.csv_table import RecordingRefused

_STEP = 900.0
"""Zones change at whole quarters of an hour."""

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
            ahead = offset_of(self._clock, utc)
            first, second = (_offset(self._clock, utc + ahead, fold) for fold in (0, 1))
            if first > second:
                self._wall, self._second = utc + ahead, ahead == second

    def read(self, dates: Array, zones: Array) -> tuple[Array, Array]:
        """As `in_zone`, for further dates."""
        bare = np.isnan(zones) & np.isfinite(dates)
        wall = np.where(bare, dates, 0.0)
        quarters, which = np.unique(np.floor(wall / _STEP), return_inverse=True)
        first, second = (
            np.array([_offset(self._clock, quarter * _STEP, f) for quarter in quarters.tolist()])
            for f in (0, 1)
        )
        first, second = first[which], second[which]
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


def offset_of(clock: ZoneInfo, utc: float) -> float:
    """Seconds that a zone is ahead of UTC at a time, s since 1970."""
    date = datetime.fromtimestamp(0, UTC) + timedelta(seconds=utc)
    return _seconds(date.astimezone(clock).utcoffset())


def _offset(clock: ZoneInfo, wall: float, fold: int) -> float:
    date = datetime(1970, 1, 1) + timedelta(seconds=wall)
    return _seconds(date.replace(tzinfo=clock, fold=fold).utcoffset())


def _seconds(offset: timedelta | None) -> float:
    return 0.0 if offset is None else offset.total_seconds()
