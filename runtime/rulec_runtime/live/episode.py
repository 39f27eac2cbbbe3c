"""Episodes, the lasting parts of a diagnosis, and events, their changes; their forms for people and
for machines."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from rich.text import Text

from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.plant_calendar import Calendar, moment
from rulec_runtime.report.wording import STATUS

Kind = Literal["fault", "sensor", "regime", "unknown", "blind", "source"]
"""A known fault; a faulty sensor; an operating regime such as dry running; a deviation without a
known fault; what cannot be judged; the connection to the plant."""

What = Literal["began", "changed", "ended", "withdrawn", "noted"]
"""`withdrawn`: later readings explain it otherwise; `noted`: reported once, does not last."""


@dataclass(frozen=True, kw_only=True)
class Episode:
    """A reported condition that lasts; times in s, as of rows.

    `id` does not change. `subject` is the fault, the sensor with its condition, the regime, or
    empty. Degrees are those of `rulec_runtime.diagnosis.steady.findings.Finding`, 1 without one.
    `status` is the letter of NE 107. `grows` describes the growth for people, `growth` is the same
    as JSON data, `rate` is per second. `told` are time and degree of the last event about it.
    """

    id: str
    kind: Kind
    subject: str
    module: str
    status: str
    since: float
    until: float
    active: bool
    text: str
    action: str = ""
    degree: float = 1.0
    lower: float = 1.0
    upper: float = 1.0
    unit: str = ""
    probability: float = 1.0
    alternatives: tuple[tuple[str, float], ...] = ()
    grows: str = ""
    rate: float = 0.0
    growth: Mapping[str, Any] = field(default_factory=dict)
    told: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Event:
    """A change of an episode; `number` counts from 1, `time` is that of the last row received, s;
    `text` says what is new, for people."""

    number: int
    time: float
    what: What
    text: str
    episode: Episode


QUIET = ("ended", "withdrawn")


def line_of(event: Event, calendar: Calendar | None) -> Text:
    """Time, symbol and letter of NE 107, what is new; a fault in words and what to do, if an
    episode begins; how long it lasted, if it ends."""
    one = event.episode
    status = "ok" if event.what in QUIET else one.status
    letter = "" if status == "ok" else f" {status}"
    when = moment(calendar, event.time)
    line = styled(
        "{}  {}{}  {} [bold]{}[/]", when, STATUS[status][0], letter, event.what, event.text
    )
    if event.what == "began" and one.kind == "fault":
        line.append_text(styled("\n    {}", one.text))
    if event.what == "began" and (one.action or one.since < event.time):
        line.append_text(styled("\n    since {}", moment(calendar, one.since)))
        if one.action:
            line.append_text(styled("; do: {}", one.action))
    if event.what == "ended":
        until = moment(calendar, one.until, one.since)
        line.append_text(styled("\n    from {} to {}", moment(calendar, one.since), until))
    return line


def with_times(event: Event, calendar: Calendar | None) -> str:
    """The text of an event, with when its episode began or was, if its own time does not say so."""
    one, text = event.episode, event.text
    since = moment(calendar, one.since, event.time)
    if event.what == "ended":
        return f"{text}; from {since} to {moment(calendar, one.until, one.since)}"
    if event.what == "began" and one.since < event.time:
        return f"{text}; since {since}"
    return text


def form_of(event: Event, plant: str, calendar: Calendar | None) -> dict[str, Any]:
    """The event as JSON data; times in s, with dates if the source has them."""
    dated = {} if calendar is None else {"date": calendar.iso(event.time)}
    episode = dataclasses.asdict(event.episode)
    growth = episode.pop("growth")
    for name in ("grows", "rate", "told"):
        del episode[name]
    rivals = [{"fault": name, "probability": p} for name, p in event.episode.alternatives]
    return {
        "plant": plant,
        "number": event.number,
        "time": event.time,
        **dated,
        "what": event.what,
        "text": event.text,
        "episode": {**episode, **growth, "alternatives": rivals},
    }
