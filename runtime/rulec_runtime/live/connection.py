"""Notices of a source as events: a plant that is not read is an alarm."""

from collections.abc import Sequence
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
    """Memory and events after a notice: lost readings begin an episode, their return ends it.

    A signal without readings, while others have some, is an episode of its own.
    """
    signal, time = notice.signal, notice.time
    lasts = bool(signal) or notice.kind in AWAY
    actions = [
        "check the logger, the network and the server; nothing is judged meanwhile",
        "look at the signal in its server and in the map; what needs it is not judged",
    ]
    one = Episode(
        id=f"{signal}.unread@{time:.3f}" if signal else f"source@{time:.3f}",
        kind="source",
        subject=signal or notice.kind,
        module=signal.partition(".")[0],
        status="C" if lasts else "ok",
        since=time,
        until=time,
        active=lasts,
        text=notice.text,
        action=actions[bool(signal)] if lasts else "",
    )
    sources = [e for e in memory.episodes if e.kind == "source" and e.active]
    before = [e for e in sources if (e.subject == signal if signal else is_away(e))]
    if not lasts:
        if notice.kind != "connected" or notice.still or not before:
            return _with(memory, (), "noted", one, time)
        one = replace(before[0], until=time, active=False, text=notice.text)
        return _with(memory, before, "ended", one, time)
    if not before:
        return _with(memory, (), "began", one, time)
    if not signal or before[0].text == notice.text:
        return memory, ()
    one = replace(one, id=before[0].id, since=before[0].since)
    return _with(memory, before, "changed", one, time)


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
        memory, events = _with(memory, [old], "ended", one, time)
        ended += events
    return memory, tuple(ended)


def _with(
    memory: Memory, before: Sequence[Episode], what: What, one: Episode, time: float
) -> tuple[Memory, tuple[Event, ...]]:
    """Memory with an episode, if that lasts, instead of those `before`, and the event of it."""
    episodes = [e for e in memory.episodes if e not in before] + [one] * one.active
    event = Event(number=memory.number + 1, time=time, what=what, text=one.text, episode=one)
    return replace(memory, episodes=tuple(episodes), number=event.number), (event,)
