"""What is remembered of the rows that have come, bounded, whatever comes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.episode import Episode
from rulec_runtime.live.history import History
from rulec_runtime.live.last_evaluation import Known
from rulec_runtime.live.looked import UnderWay
from rulec_runtime.live.rows import Rows
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.wall_clock import Calendar


@dataclass(frozen=True, kw_only=True)
class Memory:
    """All that is kept of what has come; bounded, whatever comes.

    Attributes
    ----------
    recent : the latest rows.
    before : operating points of the rows before these; none for a plant that stores.
    count : rows that have come.
    episodes : what was told and is active, or may still be seen.
    number : events told so far.
    known : what the last look at everything found, which lasts until something moves; it is not
        kept beyond the end of the process.
    under_way : a look at everything that goes on beside the rows; it ends with the process.
    """

    recent: Recording
    before: History | None = None
    count: int = 0
    episodes: tuple[Episode, ...] = ()
    number: int = 0
    known: Known | None = None
    under_way: UnderWay | None = None


def nothing_yet(ruleset: Ruleset, dated: bool) -> Memory:
    """Before the first row; `dated` if times are seconds since 1970 in UTC."""
    empty = np.zeros(0)
    calendar = Calendar(0.0, ((-np.inf, 0.0),)) if dated else None
    recent = Recording(
        time=empty,
        values={},
        segment=np.zeros(0, dtype=int),
        missing=(),
        notes=(),
        calendar=calendar,
    )
    return Memory(recent=recent)


def appended(ruleset: Ruleset, recent: Recording, rows: Rows, part: slice) -> Recording:
    """The latest rows with new ones behind them; a reading that comes late has none before."""
    time = rows.time[part]
    names = [s.id for s in ruleset.signals if s.id in recent.values or s.id in rows.values]

    def column(values: Array | None, count: int) -> Array:
        return np.full(count, np.nan) if values is None else values

    values = {}
    for name in names:
        new = rows.values.get(name)
        values[name] = np.concatenate(
            [
                column(recent.values.get(name), len(recent)),
                column(None if new is None else new[part], len(time)),
            ]
        )
    segment = int(recent.segment[-1]) if len(recent) else 0
    return replace(
        recent,
        time=np.concatenate([recent.time, time]),
        values=values,
        segment=np.concatenate([recent.segment, np.full(len(time), segment)]),
        missing=tuple(s.id for s in ruleset.signals if s.id in ruleset.read and s.id not in values),
    )
