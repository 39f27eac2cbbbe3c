"""The incremental diagnosis: rows in, events out, with the passes that judge a whole recording.

The latest rows are judged as a recording is. Of what came before remain its operating points
(`history.py`), so that memory stays bounded and a fault that lasts for days is still compared with
the readings before it. As long as no row has been given up, such a look at everything is the
diagnosis of the whole recording to the last digit.

A large plant is looked at so when there are three times as many rows, when there is no room for
more, when a sensor is in doubt, and in the end (`concluded`). In between a row that says nothing
new needs no look (`levels.py`), and where readings move only their part gets a glance
(`glance.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.sensors.conditions import SWAPPED, UNIT
from rulec_runtime.live import limits
from rulec_runtime.live.changes import changes
from rulec_runtime.live.episode import Event
from rulec_runtime.live.forgetting import without_oldest
from rulec_runtime.live.glance import glance, settled_until
from rulec_runtime.live.known import Known, known_after
from rulec_runtime.live.look import look, sight_of
from rulec_runtime.live.memory import Memory, appended, nothing_yet
from rulec_runtime.live.rows import Rows

__all__ = ["Memory", "Told", "concluded", "diagnosis_of", "follow", "nothing_yet"]


@dataclass(frozen=True)
class Told:
    """What is known after some rows, and what is new since those before."""

    memory: Memory
    events: tuple[Event, ...]
    diagnosis: Diagnosis


def follow(ruleset: Ruleset, memory: Memory, rows: Rows) -> Iterator[Told]:
    """Take rows in; a diagnosis after each block of them that memory has room for."""
    for low in range(0, len(rows), limits.KEPT_ROWS):
        part = slice(low, low + limits.KEPT_ROWS)
        recent = appended(ruleset, memory.recent, rows, part)
        new = len(rows.time[part])
        memory = replace(memory, recent=recent, count=memory.count + new)
        told = _looked(ruleset, memory) if memory.known is None else _glanced(ruleset, memory, new)
        memory = told.memory
        yield told


def concluded(ruleset: Ruleset, memory: Memory) -> Told | None:
    """A look at everything when nothing will come any more; None if the last rows had one."""
    if memory.known is None or memory.known.count == memory.count:
        return None
    return _looked(ruleset, memory)


def diagnosis_of(ruleset: Ruleset, memory: Memory) -> Diagnosis | None:
    """What the rows say that are remembered, as it was told last; None before any."""
    return _looked(ruleset, memory).diagnosis if len(memory.recent) else None


def _looked(ruleset: Ruleset, memory: Memory) -> Told:
    """Judge all that is remembered, tell what is new, and give up what there is no room for."""
    recent, judged = memory.recent, None
    if ruleset.dynamics is None:
        diagnosis, judged = look(ruleset, recent, memory.before, headers=_in_doubt(memory))
    else:
        diagnosis = diagnose(recent, ruleset)
    settled = None if judged is None else float(judged.whole.timeline.until[-1])
    told = _told(ruleset, memory, diagnosis, settled)
    known = None
    if judged is not None and _is_large(ruleset, memory):
        known = known_after(ruleset, diagnosis, judged, memory.count)
    memory = replace(told.memory, known=known)
    if len(recent) >= 2 * limits.KEPT_ROWS:
        memory = without_oldest(memory, judged, diagnosis)
    return replace(told, memory=memory)


def _in_doubt(memory: Memory) -> bool:
    """May headers be wrong? The first rows said it; later a fault that lasts looks like it."""
    misread = {UNIT.name, SWAPPED.name}
    told = (one.subject.rpartition(".")[2] for one in memory.episodes if one.kind == "sensor")
    return memory.before is None or bool(misread.intersection(told))


def _is_large(ruleset: Ruleset, memory: Memory) -> bool:
    """Does a look at everything take longer than until the next row?"""
    signals = len(memory.recent.values)
    numbers = signals * len(memory.recent)
    return signals > limits.SMALL_PLANT or numbers > limits.SEEN_AT_ONCE


def _glanced(ruleset: Ruleset, memory: Memory, new: int) -> Told:
    """Judge what moved; everything, where that is due."""
    known, recent = memory.known, memory.recent
    assert known is not None
    soon = memory.count >= limits.LOOKED_AGAIN * known.count or len(recent) >= 2 * limits.KEPT_ROWS
    if soon or new > limits.ROWS_AT_A_GLANCE or recent.values.keys() - set(known.levels.names):
        return _looked(ruleset, memory)
    levels, moved = known.levels, np.zeros(len(known.levels.names), dtype=bool)
    table = np.array([recent.values[name][-new:] for name in levels.names])
    for row in table.T:
        levels, some, odd = levels.after(row)
        moved |= some
        if odd:
            return _looked(ruleset, memory)
    known = replace(known, levels=levels)
    places = _to_be_seen(known, moved, memory.count)
    if not places:
        diagnosis = replace(known.diagnosis, samples=memory.count)
        return Told(replace(memory, known=known), (), diagnosis)
    known = glance(ruleset, recent, known, places, memory.count)
    memory = replace(memory, known=known)
    return _told(ruleset, memory, known.diagnosis, settled_until(known))


def _to_be_seen(known: Known, moved: np.ndarray, count: int) -> list[int]:
    """Places of the parts whose readings have moved, or that are to be looked at anyway."""
    names = {name for name, flag in zip(known.levels.names, moved, strict=True) if flag}
    return [
        place
        for place, one in enumerate(known.parts)
        if count >= one.due or names & one.part.ruleset.observed
    ]


def _told(ruleset: Ruleset, memory: Memory, diagnosis: Diagnosis, settled: float | None) -> Told:
    """What is new with a diagnosis."""
    sight = sight_of(memory.recent, settled)
    episodes, events = changes(ruleset, memory.episodes, diagnosis, sight, memory.number)
    memory = replace(memory, episodes=episodes, number=memory.number + len(events))
    return Told(memory, events, replace(diagnosis, samples=memory.count))
