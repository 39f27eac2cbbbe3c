"""The incremental diagnosis: rows in, events out, with the passes that judge a whole recording.

The latest rows are judged as a recording is. Of what came before remain its operating points
(`history.py`), so that memory stays bounded and a fault that lasts for days is still compared with
the readings before it. As long as no row has been given up, such a look at everything is the
diagnosis of the whole recording to the last digit.

A large plant is looked at so when there are three times as many rows, when there is no room for
more, when a sensor is in doubt, and in the end (`concluded`). In between a row that says nothing
new needs no look (`levels.py`), and where readings move only their part gets a partial update
(`partial_update.py`). Such a look may go on beside the rows that come meanwhile (`beside.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.live import limits
from rulec_runtime.live.beside import BackgroundUpdates, Due, parts_due
from rulec_runtime.live.changes import changes
from rulec_runtime.live.episode import Event
from rulec_runtime.live.full_update import horizon_of
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
from rulec_runtime.live.whole import evaluated
from rulec_runtime.recordings.mending import mended

__all__ = [
    "Memory",
    "Update",
    "concluded",
    "diagnosis_of",
    "follow",
    "looked_beside",
    "nothing_yet",
]
__all__ += ["warm_up"]


@dataclass(frozen=True)
class Update:
    """What is known after some rows, and what is new since those before."""

    memory: Memory
    events: tuple[Event, ...]
    diagnosis: Diagnosis


def follow(
    ruleset: Ruleset, memory: Memory, rows: Rows, looks: BackgroundUpdates | None = None
) -> Iterator[Update]:
    """Take rows in; a diagnosis after each block of them that memory has room for.

    `looks`: where looks at everything go on beside the rows once something is known; else rows wait
    for them, and what is told depends on nothing but rows.
    """
    for low in range(0, len(rows), limits.KEPT_ROWS):
        part = slice(low, low + limits.KEPT_ROWS)
        recent = appended(ruleset, memory.recent, rows, part)
        new = len(rows.time[part])
        memory = replace(memory, recent=recent, count=memory.count + new)
        told = _judged(ruleset, memory, new, looks)
        memory = told.memory
        yield told


def warm_up(ruleset: Ruleset) -> None:
    """Before the first row: a look at readings as they should be lays out all plans."""
    rows = common.SHORTEST_STRETCH
    values = {
        name: np.full(rows, ruleset.signal_by_id[name].reference) for name in ruleset.observed
    }
    for _ in follow(ruleset, nothing_yet(ruleset, False), Rows(np.arange(float(rows)), values)):
        pass


def looked_beside(
    ruleset: Ruleset, memory: Memory, looks: BackgroundUpdates | None
) -> Update | None:
    """What a look said that has ended while no row came; None where none has."""
    way = memory.under_way
    if way is None or looks is None or (found := way.asked.found(wait=False)) is None:
        return None
    return _taken_in(ruleset, memory, found, looks)


def concluded(ruleset: Ruleset, memory: Memory) -> Update | None:
    """A look at everything when nothing will come any more; None if the last rows had one."""
    if memory.known is None or memory.known.count == memory.count:
        return None
    return _looked(ruleset, memory)


def diagnosis_of(ruleset: Ruleset, memory: Memory) -> Diagnosis | None:
    """What the rows say that are remembered, as it was told last; None before any."""
    return _looked(ruleset, memory).diagnosis if len(memory.recent) else None


def _judged(ruleset: Ruleset, memory: Memory, new: int, looks: BackgroundUpdates | None) -> Update:
    """Judge rows by a partial update; all that is remembered where nothing is known yet, or much
    is new."""
    known, way = memory.known, memory.under_way
    if known is None or new > limits.ROWS_AT_A_GLANCE:
        return _looked(ruleset, memory)
    if memory.recent.values.keys() - set(known.levels.names):
        return _looked(ruleset, memory)
    if looks is None:
        return _partly_or_fully(ruleset, memory, known, new)
    if way is not None:
        found = way.asked.found(wait=len(memory.recent) >= limits.MOST_ROWS)
        if found is not None:
            _, due = parts_due(known, memory, new)
            memory = replace(memory, under_way=way.doubted(due.doubt))
            return _taken_in(ruleset, memory, found, looks)
    known, due = parts_due(known, memory, new)
    if way is not None:
        memory = replace(memory, under_way=way.doubted(due.doubt))
    else:
        memory = _begun_if_due(ruleset, memory, known, looks, due)
    return _partly(ruleset, memory, known, due.places)


def _looked(ruleset: Ruleset, memory: Memory) -> Update:
    """Judge all that is remembered, tell what is new, and give up what there is no room for."""
    if memory.under_way is not None:
        memory.under_way.asked.drop()
        memory = replace(memory, under_way=None)
    if ruleset.dynamics is not None:
        told = _told(ruleset, memory, diagnose(memory.recent, ruleset), None)
        memory = replace(told.memory, known=None)
        if len(memory.recent) >= 2 * limits.KEPT_ROWS:
            recent = reference_and_latest(memory.recent, memory.episodes)
            memory = replace(memory, recent=recent)
        return replace(told, memory=memory)
    found = evaluated(ruleset, memory)
    told = _told(ruleset, memory, found.diagnosis, found.settled)
    return replace(told, memory=_remembered(told.memory, found, found.known))


def _remembered(memory: Memory, found: Evaluation, known: LastEvaluation | None) -> Memory:
    """What is kept when what a look found has been told."""
    recent = without_first(memory.recent, found.cut)
    return replace(memory, recent=recent, before=found.before, known=known)


def _partly_or_fully(ruleset: Ruleset, memory: Memory, known: LastEvaluation, new: int) -> Update:
    """Judge what moved; everything, where that is due."""
    read = mended(memory.recent, known.health.mendings)
    levels, moved, odd = known.levels.after_rows(read, new)
    if odd or _is_due(memory, known):
        return _looked(ruleset, memory)
    places = sorted(known.moved(moved) | known.due(memory.count))
    return _partly(ruleset, memory, replace(known, levels=levels), places)


def _partly(ruleset: Ruleset, memory: Memory, known: LastEvaluation, places: list[int]) -> Update:
    """Judge some parts, by their places."""
    if not places:
        diagnosis = replace(known.diagnosis, samples=memory.count)
        return Update(replace(memory, known=known), (), diagnosis)
    known = partial_update(ruleset, memory.recent, known, places, memory.count)
    if (way := memory.under_way) is not None:
        way = replace(way, seen=way.seen.union(places))
    memory = replace(memory, known=known, under_way=way)
    return _told(ruleset, memory, known.diagnosis, settled_until(known.parts))


def _taken_in(
    ruleset: Ruleset, memory: Memory, found: Evaluation, looks: BackgroundUpdates
) -> Update:
    """What a look found that went on beside the rows, and what they say that came meanwhile.

    It is told as of the last row that was judged: what was told since stands or falls by all rows.
    """
    way = memory.under_way
    assert way is not None
    memory = replace(memory, under_way=None)
    if found.known is None:
        return _looked(ruleset, memory)
    known, due = parts_due(found.known, memory, memory.count - way.count)
    due = replace(due, doubt=due.doubt or way.doubt)
    if places := sorted(way.seen.union(due.places)):
        known = partial_update(ruleset, memory.recent, known, places, memory.count)
        told = _told(ruleset, memory, known.diagnosis, settled_until(known.parts))
    else:
        # Nothing was told meanwhile: the look says it as of its own rows.
        told = _told(ruleset, memory, found.diagnosis, found.settled, rows=way.kept)
    memory = _remembered(told.memory, found, known)
    return replace(told, memory=_begun_if_due(ruleset, memory, known, looks, due))


def _is_due(memory: Memory, known: LastEvaluation) -> bool:
    """Are there three times as many rows, or no room for more?"""
    full = len(memory.recent) >= 2 * limits.KEPT_ROWS
    return full or memory.count >= limits.LOOKED_AGAIN * known.count


def _begun_if_due(
    ruleset: Ruleset, memory: Memory, known: LastEvaluation, looks: BackgroundUpdates, due: Due
) -> Memory:
    """Memory with a look at everything under way, where one is due."""
    whole = due.doubt or _is_due(memory, known)
    if not whole and not due.look:
        return memory
    asked, kept = looks.begin(ruleset, memory, headers=whole), len(memory.recent)
    return replace(memory, under_way=UpdateUnderWay(asked=asked, count=memory.count, kept=kept))


def _told(
    ruleset: Ruleset,
    memory: Memory,
    diagnosis: Diagnosis,
    settled: float | None,
    rows: int | None = None,
) -> Update:
    """What is new with a diagnosis, of so many of the rows where it is not of all."""
    sight = horizon_of(memory.recent.time[:rows], settled)
    episodes, events = changes(ruleset, memory.episodes, diagnosis, sight, memory.number)
    memory = replace(memory, episodes=episodes, number=memory.number + len(events))
    return Update(memory, events, replace(diagnosis, samples=memory.count))
