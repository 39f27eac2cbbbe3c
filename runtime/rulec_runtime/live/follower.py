"""Incremental diagnosis: rows in, events out, with the passes that judge a whole recording.

The latest rows are judged like a recording. Older rows are reduced to operating points
(`history.py`), so memory is bounded and a fault that lasts for days is still compared with the
readings before it. As long as no row was dropped, such a full update equals the diagnosis of the
whole recording to the last digit.

A large plant gets a full update when there are three times as many rows, when memory is full, when
a sensor is in doubt, and in the end (`concluded`). In between, a row without news needs no update
(`levels.py`), and parts whose readings move get a partial update (`partial_update.py`). A full
update may run in the background while rows come (`background_update.py`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.live import limits
from rulec_runtime.live.background_update import BackgroundUpdates, Due, parts_due
from rulec_runtime.live.changes import changes
from rulec_runtime.live.episode import Event
from rulec_runtime.live.full_update import evaluated, horizon_of
from rulec_runtime.live.last_evaluation import Evaluation, LastEvaluation, UpdateUnderWay
from rulec_runtime.live.memory import (
    Memory,
    appended,
    nothing_yet,
    reference_and_latest,
    without_first,
)
from rulec_runtime.live.partial_update import partial_update, settled_until
from rulec_runtime.live.rows import Rows
from rulec_runtime.recordings.header_correction import mended


@dataclass(frozen=True)
class Update:
    """Memory and diagnosis after some rows, and the events since the rows before."""

    memory: Memory
    events: tuple[Event, ...]
    diagnosis: Diagnosis


def follow(
    ruleset: Ruleset, memory: Memory, rows: Rows, background: BackgroundUpdates | None = None
) -> Iterator[Update]:
    """Judge new rows; one update per block that fits into memory.

    `background` runs full updates once there is an evaluation. Without it rows wait for full
    updates, and the events depend on the rows alone.
    """
    for low in range(0, len(rows), limits.KEPT_ROWS):
        part = slice(low, low + limits.KEPT_ROWS)
        recent = appended(ruleset, memory.recent, rows, part)
        new = len(rows.time[part])
        memory = replace(memory, recent=recent, count=memory.count + new)
        update = _judged(ruleset, memory, new, background)
        memory = update.memory
        yield update


def warm_up(ruleset: Ruleset) -> None:
    """Judge reference readings before the first row, which prepares all plans."""
    rows = common.SHORTEST_STRETCH
    values = {
        name: np.full(rows, ruleset.signal_by_id[name].reference) for name in ruleset.observed
    }
    for _ in follow(ruleset, nothing_yet(False), Rows(np.arange(float(rows)), values)):
        pass


def background_update(
    ruleset: Ruleset, memory: Memory, background: BackgroundUpdates | None
) -> Update | None:
    """The result of a background update that has ended while no row came; None without one."""
    running = memory.under_way
    if running is None or background is None or (found := running.asked.found(wait=False)) is None:
        return None
    return _taken_in(ruleset, memory, found, background)


def concluded(ruleset: Ruleset, memory: Memory) -> Update | None:
    """A full update after the last row; None if that row already had one."""
    if memory.known is None or memory.known.count == memory.count:
        return None
    return _full(ruleset, memory)


def diagnosis_of(ruleset: Ruleset, memory: Memory) -> Diagnosis | None:
    """The diagnosis of the rows in memory; None before any."""
    return _full(ruleset, memory).diagnosis if len(memory.recent) else None


def _judged(
    ruleset: Ruleset, memory: Memory, new: int, background: BackgroundUpdates | None
) -> Update:
    """A partial update; a full one without an earlier evaluation, or after many rows at once."""
    known, running = memory.known, memory.under_way
    if known is None or new > limits.ROWS_AT_A_GLANCE:
        return _full(ruleset, memory)
    if memory.recent.values.keys() - set(known.levels.names):
        return _full(ruleset, memory)
    if background is None:
        read = mended(memory.recent, known.health.mendings)
        levels, moved, odd = known.levels.after_rows(read, new)
        if odd or _is_due(memory, known):
            return _full(ruleset, memory)
        places = sorted(known.moved(moved) | known.due(memory.count))
        return _partial(ruleset, memory, replace(known, levels=levels), places)
    found = None
    if running is not None:
        found = running.asked.found(wait=len(memory.recent) >= limits.MOST_ROWS)
    updated, due = parts_due(known, memory, new)
    if running is None:
        memory = _begun_if_due(ruleset, memory, updated, background, due)
    else:
        running = replace(running, doubt=running.doubt or due.doubt)
        memory = replace(memory, under_way=running)
    if found is not None:
        return _taken_in(ruleset, memory, found, background)
    return _partial(ruleset, memory, updated, due.places)


def _full(ruleset: Ruleset, memory: Memory) -> Update:
    """Judge the whole memory, then drop the rows that exceed it."""
    if memory.under_way is not None:
        memory.under_way.asked.drop()
        memory = replace(memory, under_way=None)
    if ruleset.dynamics is not None:
        update = _update(ruleset, memory, diagnose(memory.recent, ruleset), None)
        memory = replace(update.memory, known=None)
        if len(memory.recent) >= 2 * limits.KEPT_ROWS:
            recent = reference_and_latest(memory.recent, memory.episodes)
            memory = replace(memory, recent=recent)
        return replace(update, memory=memory)
    found = evaluated(ruleset, memory)
    update = _update(ruleset, memory, found.diagnosis, found.settled)
    return replace(update, memory=_trimmed(update.memory, found, found.known))


def _trimmed(memory: Memory, found: Evaluation, known: LastEvaluation | None) -> Memory:
    """Memory after a reported evaluation, without the rows that have become operating points."""
    recent = without_first(memory.recent, found.cut)
    return replace(memory, recent=recent, before=found.before, known=known)


def _partial(ruleset: Ruleset, memory: Memory, known: LastEvaluation, places: list[int]) -> Update:
    if not places:
        diagnosis = replace(known.diagnosis, samples=memory.count)
        return Update(replace(memory, known=known), (), diagnosis)
    known = partial_update(ruleset, memory.recent, known, places, memory.count)
    if (running := memory.under_way) is not None:
        running = replace(running, updated=running.updated.union(places))
    memory = replace(memory, known=known, under_way=running)
    return _update(ruleset, memory, known.diagnosis, settled_until(known.parts))


def _taken_in(
    ruleset: Ruleset, memory: Memory, found: Evaluation, background: BackgroundUpdates
) -> Update:
    """The result of a background update, after judging the rows that came meanwhile.

    It is reported as of the last judged row: all rows confirm or refute the events since.
    """
    running = memory.under_way
    assert running is not None
    memory = replace(memory, under_way=None)
    if found.known is None:
        return _full(ruleset, memory)
    known, due = parts_due(found.known, memory, memory.count - running.count)
    due = replace(due, doubt=due.doubt or running.doubt)
    if places := sorted(running.updated.union(due.places)):
        known = partial_update(ruleset, memory.recent, known, places, memory.count)
        update = _update(ruleset, memory, known.diagnosis, settled_until(known.parts))
    else:
        # Nothing was reported meanwhile, so the result is reported as of its own rows.
        update = _update(ruleset, memory, found.diagnosis, found.settled, rows=running.kept)
    memory = _trimmed(update.memory, found, known)
    return replace(update, memory=_begun_if_due(ruleset, memory, known, background, due))


def _is_due(memory: Memory, known: LastEvaluation) -> bool:
    """Whether there are several times as many rows, or memory is full."""
    full = len(memory.recent) >= 2 * limits.KEPT_ROWS
    return full or memory.count >= limits.LOOKED_AGAIN * known.count


def _begun_if_due(
    ruleset: Ruleset, memory: Memory, known: LastEvaluation, background: BackgroundUpdates, due: Due
) -> Memory:
    headers = due.doubt or _is_due(memory, known)
    if not headers and not due.full:
        return memory
    asked, kept = background.begin(ruleset, memory, headers=headers), len(memory.recent)
    return replace(memory, under_way=UpdateUnderWay(asked=asked, count=memory.count, kept=kept))


def _update(
    ruleset: Ruleset,
    memory: Memory,
    diagnosis: Diagnosis,
    settled: float | None,
    rows: int | None = None,
) -> Update:
    """The events of a diagnosis of all rows, or of the first `rows`."""
    horizon = horizon_of(memory.recent.time[:rows], settled)
    episodes, events = changes(ruleset, memory.episodes, diagnosis, horizon, memory.number)
    memory = replace(memory, episodes=episodes, number=memory.number + len(events))
    return Update(memory, events, replace(diagnosis, samples=memory.count))
