"""Incremental diagnosis: rows and notices of a source in, events out, with the passes that judge a
whole recording.

The latest rows are judged like a recording. Older rows are reduced to operating points
(`history.py`), so memory is bounded and a fault that lasts for days is still compared with the
readings before it. As long as no row was dropped, such a full update equals the diagnosis of the
whole recording to the last digit.

A large plant gets a full update when there are three times as many rows, when memory is full, when
a sensor is in doubt, and in the end (`concluded`). In between, a row without news needs no update
(`levels.py`), and parts whose readings move get a partial update (`partial_update.py`). Rows that
come during an update wait for it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.live import limits
from rulec_runtime.live.changes import changes
from rulec_runtime.live.connection import noticed, read_again
from rulec_runtime.live.episode import Event
from rulec_runtime.live.full_update import evaluated, horizon_of
from rulec_runtime.live.last_evaluation import LastEvaluation
from rulec_runtime.live.memory import Memory, appended, reference_and_latest
from rulec_runtime.live.partial_update import partial_update, settled_until
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.recordings.header_correction import mended


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
        new = len(rows.time[part])
        memory = replace(memory, recent=recent, count=memory.count + new)
        update = _updated(ruleset, memory, new)
        memory = update.memory
        yield update


def concluded(ruleset: Ruleset, memory: Memory) -> Update | None:
    """A full update after the last row; None if that row already had one."""
    if memory.known is None or memory.known.count == memory.count:
        return None
    return _full(ruleset, memory)


def diagnosis_of(ruleset: Ruleset, memory: Memory) -> Diagnosis | None:
    """The diagnosis of the rows in memory; None before any."""
    return _full(ruleset, memory).diagnosis if len(memory.recent) else None


def _updated(ruleset: Ruleset, memory: Memory, new: int) -> Update:
    """A partial update; a full one without an earlier evaluation, or after many rows at once."""
    known = memory.known
    if known is None or new > limits.ROWS_AT_A_GLANCE:
        return _full(ruleset, memory)
    if memory.recent.values.keys() - set(known.levels.names):
        return _full(ruleset, memory)
    read = mended(memory.recent, known.health.mendings)
    levels, moved, odd = known.levels.after_rows(read, new)
    full = len(memory.recent) >= 2 * limits.KEPT_ROWS
    if odd or full or memory.count >= limits.LOOKED_AGAIN * known.count:
        return _full(ruleset, memory)
    places = sorted(known.moved(moved) | known.due(memory.count))
    return _partial(ruleset, memory, replace(known, levels=levels), places)


def _full(ruleset: Ruleset, memory: Memory) -> Update:
    """Judge the whole memory, then drop the rows that exceed it."""
    if ruleset.dynamics is not None:
        update = _update(ruleset, memory, diagnose(memory.recent, ruleset), None)
        memory = replace(update.memory, known=None)
        if len(memory.recent) >= 2 * limits.KEPT_ROWS:
            recent = reference_and_latest(memory.recent, memory.episodes)
            memory = replace(memory, recent=recent)
        return replace(update, memory=memory)
    diagnosis, settled, after = evaluated(ruleset, memory)
    update = _update(ruleset, memory, diagnosis, settled)
    kept = replace(after, episodes=update.memory.episodes, number=update.memory.number)
    return replace(update, memory=kept)


def _partial(ruleset: Ruleset, memory: Memory, known: LastEvaluation, places: list[int]) -> Update:
    if not places:
        diagnosis = replace(known.diagnosis, samples=memory.count)
        return Update(replace(memory, known=known), (), diagnosis)
    known = partial_update(ruleset, memory, known, places)
    memory = replace(memory, known=known)
    return _update(ruleset, memory, known.diagnosis, settled_until(known.parts))


def _update(
    ruleset: Ruleset, memory: Memory, diagnosis: Diagnosis, settled: float | None
) -> Update:
    """The events of a diagnosis of all rows."""
    horizon = horizon_of(memory.recent.time, settled)
    episodes, events = changes(ruleset, memory.episodes, diagnosis, horizon, memory.number)
    memory = replace(memory, episodes=episodes, number=memory.number + len(events))
    return Update(memory, events, replace(diagnosis, samples=memory.count))


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
