"""Times of a recording by the clock of the plant if it has dates, else in seconds; their words."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np

from rulec_runtime.contract.plan import Array

MINUTE, HOUR, DAY = 60.0, 3600.0, 86400.0


@dataclass(frozen=True)
class Calendar:
    """Dates of a recording.

    `start` is the date of time 0 in seconds since 1970. `offsets` are pairs of a time of the
    recording, s, in order, and the offset of local time from UTC, s, from then on; empty if the
    file names no zone: its stamps are then shown unchanged. `place` names the zone of a plant whose
    later offsets are not known yet, such as Europe/Berlin; it replaces `offsets`, except on a
    machine that does not know it.
    """

    start: float
    offsets: tuple[tuple[float, float], ...] = ()
    place: str = ""

    def at(self, time: float) -> datetime:
        """The date of a time of the recording, in its zone."""
        utc = datetime.fromtimestamp(self.start, UTC) + timedelta(seconds=time)
        if self.place:
            with suppress(ZoneInfoNotFoundError):
                return utc.astimezone(ZoneInfo(self.place))
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
        found = dict[str, None]()
        for _, seconds in self.offsets:
            hours, minutes = divmod(round(abs(seconds) / MINUTE), 60)
            sign = "+" if seconds > 0 else "-"
            found[f"UTC{sign}{hours:02d}:{minutes:02d}" if seconds else "UTC"] = None
        return " and ".join(found)

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


def calendar_of(time: Array, start: float, offset: Array) -> Calendar:
    """Calendar of samples: `time`, in order, is s after `start`; `offset` is NaN without a zone."""
    finite = np.isfinite(offset)
    when, shown = time[finite], offset[finite]
    first = np.flatnonzero(np.diff(shown, prepend=np.nan) != 0.0)
    return Calendar(start, tuple(zip(when[first].tolist(), shown[first].tolist(), strict=True)))


def together(calendars: Sequence[Calendar], starts: Sequence[float]) -> Calendar:
    """The calendar of recordings in order of time, each at its start, s, on the common axis."""
    offsets: list[tuple[float, float]] = []
    for calendar, start in zip(calendars, starts, strict=True):
        for since, seconds in calendar.offsets:
            if not offsets or offsets[-1][1] != seconds:
                offsets.append((since + start, seconds))
    return Calendar(min(calendar.start for calendar in calendars), tuple(offsets))


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


ENDED, TO_THE_END, UNSETTLED, UNJUDGED = None, "", "not settled", "not judged"
BRIEFLY_GONE = "not seen, too briefly to be over"
"""What follows a finding: stretches that no longer show it, the end of the recording, or a part
that moves, cannot be judged, or is too short, in which it may continue."""


def moment(calendar: Calendar | None, time: float, before: float | None = None) -> str:
    """A time of the recording; `before` is the time mentioned last.

    >>> moment(None, 11.0)
    '11 s'
    """
    return f"{in_seconds(time)} s" if calendar is None else calendar.clock(time, before)


def in_seconds(time: float) -> str:
    """A time without a date: no second is lost, however long the recording.

    >>> in_seconds(0.25), in_seconds(1234567.8)
    ('0.25', '1234568')
    """
    return f"{time:g}" if abs(time) < 1e6 else f"{time:.0f}"


def span(calendar: Calendar | None, since: float, until: float) -> str:
    """A period in short form.

    >>> span(None, 11.0, 19.0), span(Calendar(86390.0), 0.0, 20.0)
    ('11-19 s', '1970-01-01 23:59:50 to 1970-01-02 00:00:10')
    """
    if calendar is None:
        return f"{in_seconds(since)}-{in_seconds(until)} s"
    return f"{calendar.clock(since)} to {calendar.clock(until, since)}"


def course(
    calendar: Calendar | None, since: float, until: float, behind: str | None, short: bool = False
) -> str:
    """A period and what follows it.

    >>> course(None, 11.0, 19.0, ENDED), course(None, 11.0, 19.0, UNSETTLED)
    ('11-19 s (8 s)', 'since 11 s, still active after 8 s at 19 s; from 19 s on not settled')
    """
    if behind is ENDED and since == until:
        return f"at {_in_hours(calendar, since)}"
    if behind is ENDED:
        text = span(calendar, since, until)
        return text if short else f"{text} ({duration(until - since)})"
    if short:
        return f"since {moment(calendar, since)}, still active"
    last = _in_hours(calendar, until, since)
    lasts = f"since {_in_hours(calendar, since)}, still active after {duration(until - since)}"
    lasts = f"{lasts} at {last}"
    return f"{lasts}; from {last} on {behind}" if behind else f"{lasts}, the end of the recording"


def _in_hours(calendar: Calendar | None, time: float, before: float | None = None) -> str:
    """A moment; many seconds also as hours.

    >>> _in_hours(None, 50520.0)
    '50520 s (14 h 2 min)'
    """
    text = moment(calendar, time, before)
    return text if calendar is not None or time < HOUR else f"{text} ({duration(time)})"
