"""Notices of a source as events: a plant that is not read is an alarm."""

from dataclasses import replace

import numpy as np

from rulec_runtime.live.episode import Episode, Event, What
from rulec_runtime.live.memory import Memory
from rulec_runtime.live.rows import Notice, Rows

AWAY = ("lost", "stale")


def is_away(episode: Episode) -> bool:
    """Whether the episode means that the plant is not read at all."""
    return episode.kind == "source" and episode.active and episode.subject in AWAY


def noticed(memory: Memory, notice: Notice) -> tuple[Memory, tuple[Event, ...]]:
    """Memory and events after a notice: lost readings begin an episode, their return ends it."""
    if notice.signal:
        return _unread(memory, notice)
    away = [one for one in memory.episodes if is_away(one)]
    others = tuple(one for one in memory.episodes if one not in away)
    what: What = "noted"
    one = Episode(
        id=f"source@{notice.time:.3f}",
        kind="source",
        subject=notice.kind,
        module="",
        status="C" if notice.kind in AWAY else "ok",
        since=notice.time,
        until=notice.time,
        active=False,
        text=notice.text,
        action=(
            "check the logger, the network and the server; nothing is judged meanwhile"
            if notice.kind in AWAY
            else ""
        ),
    )
    if notice.kind in AWAY:
        if away:
            return memory, ()
        what, one = "began", replace(one, active=True)
        others = (*others, one)
    elif notice.kind == "connected" and away and not notice.still:
        what = "ended"
        one = replace(away[0], until=notice.time, active=False, text=notice.text)
    elif away:
        others = (*others, *away)
    return _with(memory, others, what, one, notice.time)


def _unread(memory: Memory, notice: Notice) -> tuple[Memory, tuple[Event, ...]]:
    """A signal without readings, while others have some, is an episode of its own."""
    before = [
        e for e in memory.episodes if e.kind == "source" and e.active and e.subject == notice.signal
    ]
    if before and before[0].text == notice.text:
        return memory, ()
    one = Episode(
        id=f"{notice.signal}.unread@{notice.time:.3f}",
        kind="source",
        subject=notice.signal,
        module=notice.signal.partition(".")[0],
        status="C",
        since=notice.time,
        until=notice.time,
        active=True,
        text=notice.text,
        action="look at the signal in its server and in the map; what needs it is not judged",
    )
    if before:
        one = replace(one, id=before[0].id, since=before[0].since)
    others = tuple(e for e in memory.episodes if e not in before)
    return _with(memory, (*others, one), "changed" if before else "began", one, notice.time)


def read_again(memory: Memory, rows: Rows) -> tuple[Memory, tuple[Event, ...]]:
    """Memory and events after rows: a signal without readings has one in the last row again, or is
    no longer requested."""
    ended: list[Event] = []
    time = float(rows.time[-1])
    for old in [e for e in memory.episodes if e.kind == "source" and e.active and not is_away(e)]:
        column = rows.values.get(old.subject)
        if column is not None and not np.isfinite(column[-1]):
            continue
        text = f"{old.subject} is " + ("not asked for any more" if column is None else "read again")
        one = replace(old, until=time, active=False, text=text)
        others = tuple(e for e in memory.episodes if e is not old)
        memory, events = _with(memory, others, "ended", one, time)
        ended += events
    return memory, tuple(ended)


def _with(
    memory: Memory, episodes: tuple[Episode, ...], what: What, one: Episode, time: float
) -> tuple[Memory, tuple[Event, ...]]:
    number = memory.number + 1
    event = Event(number=number, time=time, what=what, text=one.text, episode=one)
    return replace(memory, episodes=episodes, number=number), (event,)
