"""Word times by the clock of the plant if the recording has dates, else in seconds."""

from __future__ import annotations

from rulec_runtime.recordings.plant_calendar import HOUR, Calendar, duration

ENDED, TO_THE_END, UNSETTLED, UNJUDGED = None, "", "not settled", "not judged"
BRIEFLY_GONE = "not seen, too briefly to be over"
"""What follows a finding: stretches that no longer show it, the end of the recording, or a part
that moves, cannot be judged, or is too short, in which it may continue."""


def moment(calendar: Calendar | None, time: float, before: float | None = None) -> str:
    """A time of the recording; `before` is the time mentioned last.

    >>> moment(None, 11.0)
    '11 s'
    """
    return f"{time:g} s" if calendar is None else calendar.clock(time, before)


def span(calendar: Calendar | None, since: float, until: float) -> str:
    """A period in short form.

    >>> span(None, 11.0, 19.0), span(Calendar(86390.0), 0.0, 20.0)
    ('11-19 s', '1970-01-01 23:59:50 to 1970-01-02 00:00:10')
    """
    if calendar is None:
        return f"{since:g}-{until:g} s"
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
