"""Incremental diagnosis: rows and notices of a source in, events out, with the passes that judge a
whole recording.

The latest rows are judged like a recording. Older rows are reduced to operating points
(`history.py`), so memory is bounded and a fault that lasts for days is still compared with the
readings before it. As long as no row was dropped, the result equals the diagnosis of the whole
recording to the last digit.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.live import limits
from rulec_runtime.live.changes import Horizon, changes
from rulec_runtime.live.connection import noticed, read_again
from rulec_runtime.live.episode import Event
from rulec_runtime.live.judge_memory import judged_memory
from rulec_runtime.live.memory import Memory, appended, reference_and_latest
from rulec_runtime.live.rows import Notice, Rows


@dataclass(frozen=True)
class Update:
    """Memory and diagnosis after some rows, and the events since the rows before."""

    memory: Memory
    events: tuple[Event, ...]
    diagnosis: Diagnosis


def follow(ruleset: Ruleset, memory: Memory, rows: Rows) -> Iterator[Update]:
    """Judge new rows; one update per block that fits into memory."""
    for low in range(0, len(rows), limits.KEPT_ROWS):
        part = slice(low, low + limits.KEPT_ROWS)
        recent = appended(ruleset, memory.recent, rows, part)
        memory = replace(memory, recent=recent, count=memory.count + len(rows.time[part]))
        update = _updated(ruleset, memory)
        memory = update.memory
        yield update


def diagnosis_of(ruleset: Ruleset, memory: Memory) -> Diagnosis | None:
    """The diagnosis of the rows in memory; None before any."""
    return _updated(ruleset, memory).diagnosis if len(memory.recent) else None


def _updated(ruleset: Ruleset, memory: Memory) -> Update:
    """Judge the whole memory, then drop the rows that exceed it."""
    diagnosis, settled, after = judged_memory(ruleset, memory)
    time = memory.recent.time
    horizon = Horizon(time, float(time[-1]) if settled is None else settled)
    episodes, events = changes(ruleset, memory.episodes, diagnosis, horizon, memory.number)
    after = replace(after, episodes=episodes, number=memory.number + len(events))
    if ruleset.dynamics is not None and len(after.recent) >= 2 * limits.KEPT_ROWS:
        after = replace(after, recent=reference_and_latest(after.recent, episodes))
    return Update(after, events, replace(diagnosis, samples=memory.count))


def judged(
    ruleset: Ruleset, memory: Memory, came: Sequence[Rows | Notice]
) -> Iterator[tuple[Memory, tuple[Event, ...], Diagnosis | None]]:
    """Memory and events after each block of rows and each notice, and the diagnosis of the rows."""
    for item in _blocks(came):
        if isinstance(item, Notice):
            memory, events = noticed(memory, item)
            yield memory, events, None
            continue
        memory, events = read_again(memory, item)
        if events:
            yield memory, events, None
        for update in follow(ruleset, memory, item):
            memory = update.memory
            yield memory, update.events, update.diagnosis


def _blocks(came: Sequence[Rows | Notice]) -> Iterator[Rows | Notice]:
    """Notices, and successive rows of the same signals as one block."""
    for _, group in groupby(came, lambda item: isinstance(item, Rows) and set(item.values)):
        items = list(group)
        rows = [item for item in items if isinstance(item, Rows)]
        if not rows:
            yield from items
            continue
        values = {name: np.concatenate([r.values[name] for r in rows]) for name in rows[0].values}
        yield Rows(np.concatenate([r.time for r in rows]), values)
