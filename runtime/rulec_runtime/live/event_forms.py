"""Forms of an event: a line for people, an object for machines."""

from __future__ import annotations

import dataclasses
from typing import Any

from rich.text import Text

from rulec_runtime.live.episode import Event
from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.recordings.time_text import moment
from rulec_runtime.report.wording import STATUS

QUIET = ("ended", "withdrawn")


def line_of(event: Event, calendar: Calendar | None) -> Text:
    """Time, symbol and letter of NE 107, what is new; what to do, if an episode begins."""
    one = event.episode
    status = "ok" if event.what in QUIET else one.status
    letter = "" if status == "ok" else f" {status}"
    when = moment(calendar, event.time)
    line = styled(
        "{}  {}{}  {} [bold]{}[/]", when, STATUS[status][0], letter, event.what, event.text
    )
    if event.what == "began" and one.action:
        line.append_text(styled("\n    since {}; do: {}", moment(calendar, one.since), one.action))
    return line


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
