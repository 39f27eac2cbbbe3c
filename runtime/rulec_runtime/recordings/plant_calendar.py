"""Convert times of a recording to the clock of the plant."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.larger_than_memory import blocks

MINUTE, HOUR, DAY = 60.0, 3600.0, 86400.0


@dataclass(frozen=True)
class Calendar:
    """Dates of a recording.

    `start` is the date of time 0 in seconds since 1970. `offsets` are pairs of a time of the
    recording, s, in order, and the offset of local time from UTC, s, from then on; empty if the
    file names no zone: its stamps are then shown unchanged.
    """

    start: float
    offsets: tuple[tuple[float, float], ...] = ()

    def at(self, time: float) -> datetime:
        """The date of a time of the recording, in its zone."""
        utc = datetime.fromtimestamp(self.start, UTC) + timedelta(seconds=time)
        offset = None
        for since, seconds in self.offsets:
            if offset is None or time >= since:
                offset = seconds
        if offset is None:
            return utc.replace(tzinfo=None)
        return utc.astimezone(timezone(timedelta(seconds=offset)))

    def iso(self, time: float) -> str:
        """ISO 8601, with the zone if the recording names one."""
        date = self.at(time)
        return date.isoformat(timespec="milliseconds" if date.microsecond else "seconds")

    def zone(self) -> str:
        """Zone of the dates, in words."""
        if not self.offsets:
            return "the recording names no zone"
        return " and ".join(dict.fromkeys(_offset(seconds) for _, seconds in self.offsets))

    def zero(self) -> str:
        """The date of time 0, in words."""
        return f"time 0 s is {self.clock(0.0)} ({self.zone()})"

    def clock(self, time: float, before: float | None = None) -> str:
        """Date and time of day; the time alone if `before` is on the same day."""
        date = self.at(time)
        same_day = before is not None and self.at(before).date() == date.date()
        day = "" if same_day else f"{date:%Y-%m-%d} "
        fine = f".{date.microsecond // 100_000}" if date.microsecond >= 100_000 else ""
        return f"{day}{date:%H:%M:%S}{fine}"


def _offset(seconds: float) -> str:
    if seconds == 0:
        return "UTC"
    sign = "+" if seconds > 0 else "-"
    minutes = round(abs(seconds) / MINUTE)
    return f"UTC{sign}{minutes // 60:02d}:{minutes % 60:02d}"


def calendar_of(time: Array, start: float, offset: Array) -> Calendar:
    """Calendar of samples: `time`, in order, is s after `start`; `offset` is NaN without a zone."""
    found: list[tuple[float, float]] = []
    for low, high in blocks(len(time), time, offset):
        known = np.isfinite(offset[low:high])
        when, shown = time[low:high][known], offset[low:high][known]
        before = np.concatenate([[found[-1][1] if found else np.nan], shown[:-1]])
        first = np.flatnonzero(shown != before[: len(shown)])
        found += zip(when[first].tolist(), shown[first].tolist(), strict=True)
    return Calendar(start, tuple(found))


def duration(seconds: float) -> str:
    """A duration in words.

    >>> duration(8.0), duration(90.0), duration(7260.0), duration(200000.0)
    ('8 s', '1 min 30 s', '2 h 1 min', '2 d 7 h')
    """
    if seconds < MINUTE:
        return f"{seconds:.3g} s"
    whole = round(seconds)
    for big, name, small, second in (
        (DAY, "d", HOUR, "h"),
        (HOUR, "h", MINUTE, "min"),
        (MINUTE, "min", 1.0, "s"),
    ):
        if whole >= big:
            rest = int(whole % big // small)
            return f"{int(whole // big)} {name}" + (f" {rest} {second}" if rest else "")
    return f"{whole} s"
