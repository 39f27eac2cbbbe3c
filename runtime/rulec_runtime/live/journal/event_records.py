"""Events as records of a table and as JSON; equal events have equal records."""

import json
import math
import re
from dataclasses import dataclass
from typing import Any

from rulec_runtime.live.episode import Episode, Event, form_of
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.refused import JournalRefused
from rulec_runtime.output.terminal import SHOWN_INSTEAD, machine_text
from rulec_runtime.recordings.plant_calendar import Calendar

Record = dict[str, Any]

UTC = Calendar(0.0, ((-math.inf, 0.0),))
"""Times of a dated source."""

_UNKEPT = re.compile("[\0\ud800-\udfff]")
"""Characters that databases do not store: null, and lone surrogates."""

TEXTS = ("kind", "subject", "module", "status", "unit", "action")
NUMBERS = ("since", "until", "degree", "lower", "upper", "probability")
"""Fields of an episode that a record has under the same name."""


@dataclass(frozen=True)
class Entry:
    """An event of a plant; `iso` is its time in UTC, None without dates; `by` and `at` are who
    acknowledged its episode, and when, s since 1970, or None."""

    plant: str
    event: Event
    iso: str | None
    by: str | None
    at: float | None

    @property
    def dated(self) -> bool:
        """Whether times are s since 1970."""
        return self.iso is not None


def record_of(event: Event, dated: bool) -> Record:
    """An event with its episode; `dated` if times are s since 1970 in UTC.

    `text` says what is new, `told` describes the episode. A number that is not finite is None.
    """
    episode = event.episode
    if not math.isfinite(event.time):
        raise JournalRefused(f"event {event.number} has no time")
    return {
        "number": event.number,
        "iso": iso(event.time) if dated else None,
        "time": float(event.time),
        "what": keepable(event.what),
        "text": keepable(event.text),
        "episode": keepable(episode.id),
        "told": keepable(episode.text),
        "active": episode.active,
        "alternatives": [[keepable(name), _finite(share)] for name, share in episode.alternatives],
        **{name: keepable(getattr(episode, name)) for name in TEXTS},
        **{name: _finite(getattr(episode, name)) for name in NUMBERS},
    }


def event_of(record: Record) -> Event:
    """The event of a record; raises `JournalRefused` for an invalid one."""
    try:
        number, active = record["number"], record["active"]
        if type(number) is not int or type(active) is not bool:
            raise TypeError
        fields: dict[str, Any] = {
            **{name: _text(record[name]) for name in TEXTS},
            **{name: _number(record[name]) for name in NUMBERS},
        }
        episode = Episode(
            id=_text(record["episode"]),
            text=_text(record["told"]),
            active=active,
            alternatives=tuple((_text(n), _number(p)) for n, p in record["alternatives"]),
            growth=dict(record.get("growth", {})),
            **fields,
        )
        return Event(
            number=number,
            time=_number(record["time"]),
            what=_text(record["what"]),  # type: ignore[arg-type]
            text=_text(record["text"]),
            episode=episode,
        )
    except (KeyError, TypeError, ValueError):
        raise JournalRefused("this is no event") from None


def other_content(where: str, plant: str, number: int, old: Record, new: Record) -> JournalRefused:
    """The refusal of an event whose number another event already has."""
    return JournalRefused(
        f"{where} holds another event {number} of {plant}: '{old['text']}' at "
        f"{moment(old)}, now '{new['text']}' at {moment(new)}; this watcher started from another "
        "state than that in the journal: watch into another journal, or under another plant name"
    )


def form_for(event: Event, plant: str, dated: bool) -> Record:
    """An event as JSON data, with texts and numbers that can be stored."""
    form: Record = storable(form_of(event, plant, UTC if dated else None))
    return form


def json_line(form: Record) -> str:
    """JSON data as one line that cannot control a terminal."""
    return machine_text(json.dumps(form, ensure_ascii=False, allow_nan=False)) + "\n"


def moment(record: Record) -> str:
    """When an event was, for people."""
    return str(record.get("iso") or record.get("date") or f"{record['time']:g} s")


def iso(time: float) -> str | None:
    """ISO 8601 in UTC; None beyond the calendar.

    >>> iso(1.5), iso(1e30)
    ('1970-01-01T00:00:01.500+00:00', None)
    """
    try:
        return UTC.iso(time)
    except (ValueError, OverflowError, OSError):
        return None


def name_of(text: str) -> str:
    """The name of a person or a watcher as it is stored."""
    return keepable(text)[: limits.LONGEST_NAME]


def keepable(text: str) -> str:
    """A text as it is stored: truncated, and without invalid characters."""
    return _UNKEPT.sub(SHOWN_INSTEAD, text)[: limits.LONGEST_TEXT]


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _number(value: Any) -> float:
    if value is None:
        return math.nan
    if type(value) not in (int, float):
        raise TypeError
    return float(value)


def _text(value: Any) -> str:
    if type(value) is not str:
        raise TypeError
    return value


def storable(value: Any) -> Any:
    """JSON data with texts that can be stored, and None for numbers that are not finite."""
    if isinstance(value, str):
        return keepable(value)
    if isinstance(value, float):
        return _finite(value)
    if isinstance(value, dict):
        return {key: storable(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [storable(part) for part in value]
    return value
