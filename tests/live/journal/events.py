"""Events as a watcher tells them."""

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from rulec_runtime.live.episode import Episode, Event
from rulec_runtime.live.journal.store import Journal

LEAKAGE = Episode(
    id="A.leakage@1700000000.000",
    kind="fault",
    subject="A.leakage",
    module="A",
    status="S",
    since=1.7e9,
    until=1.7e9 + 20.0,
    active=True,
    text="leakage past the impeller of A",
    action="check the wear ring",
    degree=0.17,
    lower=0.15,
    upper=0.19,
    probability=0.9,
    alternatives=(("A.clogging", 0.1),),
)


def event(number: int, episode: Episode = LEAKAGE, **other: object) -> Event:
    """An event a second."""
    fields = {"what": "changed", "text": f"A.leakage told for the {number}th time", **other}
    return Event(number=number, time=1.7e9 + number, episode=episode, **fields)  # type: ignore[arg-type]


def story() -> list[Event]:
    """A leakage that goes on, a sensor that failed and is well again."""
    names = {"id": "B.p@1700000005.000", "subject": "B.p", "module": "B"}
    condition = {"kind": "sensor", "status": "C", "text": "B.p stands still", "action": ""}
    stuck = replace(LEAKAGE, alternatives=(), **names, **condition)  # type: ignore[arg-type]
    return [
        event(1, what="began", text="A.leakage 0.170 (0.150 to 0.190)"),
        event(2, stuck, what="began", text="B.p stands still"),
        event(3),
        event(4, replace(stuck, active=False), what="ended", text="B.p healthy again"),
    ]


def event_in(form: dict[str, Any]) -> Event:
    names, own = {f.name for f in fields(Episode)}, ("number", "time", "what", "text")
    episode = {name: part for name, part in form["episode"].items() if name in names}
    rivals = tuple((r["fault"], r["probability"]) for r in episode.pop("alternatives"))
    condition = Episode(**episode, alternatives=rivals)
    return Event(**{name: form[name] for name in own}, episode=condition)


def events_in(file: Path) -> list[Event]:
    """The events of a file of lines, all of them whole."""
    lines = file.read_bytes().split(b"\n")
    assert lines.pop() == b""
    return [event_in(json.loads(line)) for line in lines]


def stored_in(journal: Journal) -> tuple[int, bytes]:
    """The state of plant abc that a journal keeps, and the number of the last event before it."""
    saved = journal.state("abc")
    assert saved is not None
    return saved.number, saved.state
