"""Events that were reported after the last saved state, as the process was killed in between.

The rows after the state come again, perhaps in other blocks, and might give different events under
the same numbers. Instead the watch restores the reported events, and judges those rows at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from rulec_runtime.live.episode import Event
from rulec_runtime.live.memory import Memory
from rulec_runtime.live.rows import Notice, Rows, Source


def replayed(memory: Memory, events: Sequence[Event]) -> Memory:
    """Memory as it was after these events, except for the rows."""
    episodes = {one.id: one for one in memory.episodes}
    number = memory.number
    for event in events:
        if event.number > number:
            one = event.episode
            episodes[one.id] = replace(one, told=(one.until, one.degree))
            number = event.number
    kept = (one for one in episodes.values() if one.active or one.kind != "source")
    return replace(memory, episodes=tuple(kept), number=number)


class ReplayedSource:
    """A source that hands out at once all rows that were already judged."""

    def __init__(self, source: Source, events: Sequence[Event]) -> None:
        self._source = source
        times = [event.time for event in events if event.episode.kind != "source"]
        self._until = max(times, default=-float("inf"))

    @property
    def dated(self) -> bool:
        return self._source.dated

    @property
    def ended(self) -> bool:
        return self._source.ended

    @property
    def position(self) -> Mapping[str, Any]:
        """The position at which reading continues; empty for a source without one."""
        position: Mapping[str, Any] = getattr(self._source, "position", {})
        return position

    def take(self, seconds: float) -> list[Rows | Notice]:
        found = more = self._source.take(seconds)
        while more:
            times = [float(p.time[-1]) for p in found if isinstance(p, Rows)]
            if max(times, default=float("inf")) >= self._until:
                break
            more = self._source.take(0.0)
            found = [*found, *more]
        return found

    def close(self) -> None:
        self._source.close()
