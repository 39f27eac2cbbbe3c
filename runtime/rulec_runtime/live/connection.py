"""What a source says of its connection, as events: a plant that is not read is an alarm."""

from __future__ import annotations

from dataclasses import replace

from rulec_runtime.live.episode import Episode, Event, What
from rulec_runtime.live.follower import Memory
from rulec_runtime.live.rows import Notice

AWAY = ("lost", "stale")
ACTION = "check the logger, the network and the server; nothing is judged meanwhile"


def noticed(memory: Memory, notice: Notice) -> tuple[Memory, tuple[Event, ...]]:
    """What a notice changes: readings that stay away begin an episode, coming back ends it."""
    away = [one for one in memory.episodes if one.kind == "source" and one.active]
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
        action=ACTION if notice.kind in AWAY else "",
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
    number = memory.number + 1
    event = Event(number=number, time=notice.time, what=what, text=notice.text, episode=one)
    return replace(memory, episodes=others, number=number), (event,)
