"""Events against what was planted, and against those of a watch that nobody disturbed."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from rulec_runtime.live.episode import Episode, Event
from rulec_runtime.live.journal.refused import JournalRefused
from rulec_runtime.live.journal.store import open_journal

from rulec.simulation.prediction import Injected
from tests.conftest import compiled
from tests.figures.share import Share
from tests.live.journal.events import events_in

Known = tuple[str, float]
"""A fault and since when."""


def events_of(journal: Path | str) -> list[Event]:
    """All events of plant abc in a journal, in order of their numbers."""
    with closing(open_journal(str(journal), make=False)) as opened:
        found = [entry.event for entry in opened.events("abc")]
    return sorted(found, key=lambda e: e.number)


def events_from(lines: Path) -> list[Event]:
    return events_in(lines)


def rows_of(journal: Path | str) -> tuple[int, list[float]]:
    """How many rows the state of a journal counts, and times of those that it still holds; none
    where no state is kept yet."""
    try:
        with closing(open_journal(str(journal), make=False)) as opened:
            saved = opened.state("abc")
    except JournalRefused:  # it is not made yet
        saved = None
    return (0, []) if saved is None else _rows(saved.state, str(journal))


def rows_in(state: Path) -> tuple[int, list[float]]:
    return _rows(state.read_bytes(), str(state)) if state.exists() else (0, [])


def _rows(state: bytes, name: str) -> tuple[int, list[float]]:
    from rulec_runtime.live.state import from_bytes

    memory, _ = from_bytes(compiled("abc"), state, name)
    return memory.count, [float(t) for t in memory.recent.time]


def outcome(
    events: Sequence[Event],
    planted: Sequence[Injected],
    end: float = float("inf"),
    said: str = "",
) -> dict[str, Any]:
    """What all parts say of their events, and of what the watch wrote on the terminal."""
    found = numbers(events) | against_plant(events, planted, end) | bad_output(said)
    return {"events": len(events), **found}


def numbers(events: Iterable[Event]) -> dict[str, int]:
    """Numbers of events that are missing, or there twice."""
    there = [event.number for event in events]
    return {
        "numbers_lost": max(there, default=0) - len(set(there)),
        "numbers_twice": len(there) - len(set(there)),
    }


def told(events: Sequence[Event]) -> list[Event]:
    """The last event of each episode of a fault, a sensor or something unknown, unless that was
    withdrawn."""
    last: dict[str, Event] = {}
    for event in events:
        if event.episode.kind in ("fault", "sensor", "unknown"):
            last[event.episode.id] = event
    return [event for event in last.values() if event.what != "withdrawn"]


def against_plant(
    events: Sequence[Event], planted: Sequence[Injected], end: float
) -> dict[str, Any]:
    """Faults over before `end` that were told once, never, more than once; what nobody planted."""
    episodes = [event.episode for event in told(events)]
    over = [f for f in planted if f.until < end]
    count = [sum(_is_of(e, f) for e in episodes) for f in over]
    strange = [
        f"{e.subject or e.text}@{e.since:.0f}"
        for e in episodes
        if not any(_is_of(e, f) for f in planted)
    ]
    return {
        "faults": len(over),
        "faults_lost": sum(n == 0 for n in count),
        "faults_twice": sum(n > 1 for n in count),
        "faults_strange": len(strange),
        "strange": strange,
    }


def _is_of(episode: Episode, fault: Injected) -> bool:
    at_one_time = episode.since <= fault.until and fault.since <= episode.until
    return episode.subject == fault.fault and at_one_time


def against_undisturbed(events: Sequence[Event], quiet: Sequence[Event]) -> dict[str, int]:
    """Episodes by name and beginning: those of the undisturbed watch that are missing, and those
    that are there beyond them."""
    mine, theirs = ([_known(e) for e in told(part)] for part in (events, quiet))
    return {
        "episodes": len(theirs),
        "lost": sum(max(theirs.count(k) - mine.count(k), 0) for k in set(theirs)),
        "twice": sum(max(mine.count(k) - theirs.count(k), 0) for k in set(mine)),
    }


def _known(event: Event) -> Known:
    return event.episode.subject or event.episode.kind, event.episode.since


def bad_output(text: str) -> dict[str, int]:
    """Tracebacks, and characters that steer a terminal."""
    steering = sum(1 for c in text if (ord(c) < 32 and c not in "\n\t") or 127 <= ord(c) < 160)
    return {"tracebacks": text.count("Traceback"), "steering": steering}


LOST = ("numbers_lost", "rows_lost", "lost", "faults_lost", "episodes_without_end")
TWICE = ("numbers_twice", "rows_twice", "twice", "faults_twice", "episodes_ended_twice")
BAD = ("tracebacks", "steering")


def summed(form: Mapping[str, Any]) -> dict[str, Any]:
    """The form with these; as it is where the part was skipped."""
    if "skipped" in form:
        return dict(form)
    return {
        **form,
        "went_on": Share(form["survived"], form["tried"]).form(),
        "all_lost": sum(form.get(name, 0) for name in LOST),
        "all_twice": sum(form.get(name, 0) for name in TWICE),
        "all_bad": sum(form.get(name, 0) for name in BAD),
    }
