"""The incremental diagnosis: rows in, events out, with the passes that judge a whole recording.

The latest rows are judged as a recording is. Of what came before remain its operating points
(`history.py`), so that memory stays bounded and a fault that lasts for days is still compared with
the readings before it. As long as no row has been given up, the diagnosis is that of the whole
recording to the last digit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, assembled, diagnose, restless, told_of
from rulec_runtime.diagnosis.sensors.judge import examine
from rulec_runtime.diagnosis.steady.findings import Found, Period
from rulec_runtime.diagnosis.steady.seen import Seen, judgeable, see_points
from rulec_runtime.live import limits
from rulec_runtime.live.changes import changes
from rulec_runtime.live.episode import Episode, Event
from rulec_runtime.live.history import History, history_of, joined, some
from rulec_runtime.live.rows import Rows
from rulec_runtime.live.sight import Sight
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Stretches
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
    """

    recent: Recording
    before: History | None = None
    count: int = 0
    episodes: tuple[Episode, ...] = ()
    number: int = 0


@dataclass(frozen=True)
class Told:
    """What is known after some rows, and what is new since those before."""

    memory: Memory
    events: tuple[Event, ...]
    diagnosis: Diagnosis


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


def follow(ruleset: Ruleset, memory: Memory, rows: Rows) -> Iterator[Told]:
    """Take rows in; a diagnosis after each block of them that memory has room for."""
    for low in range(0, len(rows), limits.KEPT_ROWS):
        part = slice(low, low + limits.KEPT_ROWS)
        recent = _appended(ruleset, memory.recent, rows, part)
        count = memory.count + len(rows.time[part])
        told = _looked(ruleset, replace(memory, recent=recent, count=count))
        memory = told.memory
        yield told


def diagnosis_of(ruleset: Ruleset, memory: Memory) -> Diagnosis | None:
    """What the rows say that are remembered, as it was told last; None before any."""
    return _looked(ruleset, memory).diagnosis if len(memory.recent) else None


def _appended(ruleset: Ruleset, recent: Recording, rows: Rows, part: slice) -> Recording:
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


def _looked(ruleset: Ruleset, memory: Memory) -> Told:
    """Judge all that is remembered, tell what is new, and give up what there is no room for."""
    if ruleset.dynamics is None:
        diagnosis, judged = _settled(ruleset, memory)
    else:
        diagnosis, judged = diagnose(memory.recent, ruleset), None
    sight = _sight(memory.recent, judged)
    episodes, events = changes(ruleset, memory.episodes, diagnosis, sight, memory.number)
    memory = replace(memory, episodes=episodes, number=memory.number + len(events))
    if len(memory.recent) >= 2 * limits.KEPT_ROWS:
        memory = _without_oldest(memory, judged, diagnosis)
    return Told(memory, events, replace(diagnosis, samples=memory.count))


@dataclass(frozen=True)
class _Judged:
    """Operating points of all that is remembered, the stretches of the latest rows, and what all
    blocks of estimates say of the points."""

    whole: History
    own: History
    stretches: Stretches
    seen: tuple[Seen, ...]


def _settled(ruleset: Ruleset, memory: Memory) -> tuple[Diagnosis, _Judged | None]:
    """The passes of a recording, over the points of what came before as well."""
    health = examine(memory.recent, ruleset)
    recording = health.recording
    stretches, noise = judgeable(recording, ruleset, "default")
    own = history_of(recording, ruleset, stretches, noise)
    whole = own if memory.before is None else joined(memory.before, recording, own)
    if not len(whole):
        since, until = float(recording.time[0]), float(recording.time[-1])
        found = Found([], [], [Period(since, until, restless(len(recording)))])
        return assembled(health, ruleset, "default", judged=0, found=found), None
    seen = see_points(ruleset, whole.points, whole.halves, "default")
    samples, found = told_of(ruleset, whole.timeline, seen)
    found.not_judged.extend(_unsettled(recording, whole))
    diagnosis = assembled(health, ruleset, "default", judged=samples, found=found)
    return diagnosis, _Judged(whole, own, stretches, tuple(seen))


def _unsettled(recording: Recording, whole: History) -> Iterator[Period]:
    """Rows behind the last stretch, if they are too many for the way to an operating point."""
    rows = int(whole.timeline.later[-1])
    if rows >= limits.BLIND_ROWS:
        text = "the plant does not settle: readings jump or move too fast"
        first = max(len(recording) - rows, 0)
        yield Period(float(recording.time[first]), float(recording.time[-1]), text)


def _sight(recent: Recording, judged: _Judged | None) -> Sight:
    """How far a diagnosis looks."""
    time = recent.time
    interval = float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    until = time if judged is None else judged.whole.timeline.until
    return Sight(
        since=float(time[0]),
        until=float(time[-1]),
        settled=float(until[-1]),
        usual=limits.BLIND_ROWS * interval,
        time=time,
        pause=common.SETTLING,
    )


def _without_oldest(memory: Memory, judged: _Judged | None, diagnosis: Diagnosis) -> Memory:
    """The older half of the rows becomes operating points."""
    recent = memory.recent
    if diagnosis.ruleset.dynamics is not None:
        return replace(memory, recent=_reference_and_latest(recent, memory.episodes))
    cut = len(recent) - limits.KEPT_ROWS
    before = memory.before
    if judged is not None:
        # A stretch that goes on behind the cut stays whole.
        firsts = judged.stretches.first
        cut = int(firsts[firsts >= cut][0]) if (firsts >= cut).any() else cut
        gone = np.ones(len(judged.whole), dtype=bool)
        gone[len(gone) - len(firsts) :] = judged.stretches.last <= cut
        gone &= ~_over(judged, diagnosis)
        before = _thinned(some(judged.whole, gone))
        timeline = replace(before.timeline, later=before.timeline.later - (len(recent) - cut))
        before = replace(before, timeline=timeline)
    return replace(memory, recent=_rows(recent, np.arange(cut, len(recent))), before=before)


def _over(judged: _Judged, diagnosis: Diagnosis) -> np.ndarray:
    """Points of what has ended, shape (n,): told, and no part of what is compared with."""
    timeline = judged.whole.timeline
    odd = np.any([part.isolation.deviating for part in judged.seen], axis=0)
    for finding in diagnosis.findings:
        if finding.active:
            odd &= (timeline.until < finding.since) | (timeline.since > finding.until)
    over: np.ndarray = odd
    if len(over):
        over[-1] = False
    return over


def _thinned(history: History) -> History:
    """Every second point of the older half goes where there are too many."""
    while len(history) > limits.MOST_POINTS:
        keep = np.ones(len(history), dtype=bool)
        keep[1 : len(history) // 2 : 2] = False
        history = some(history, keep)
    return history


def _reference_and_latest(recent: Recording, episodes: tuple[Episode, ...]) -> Recording:
    """The latest rows; while a fault is there, also those before it, which it is compared with."""
    n, kept = len(recent), limits.KEPT_ROWS
    active = [one.since for one in episodes if one.kind == "fault" and one.active]
    sound = int(np.searchsorted(recent.time, min(active))) if active else 0
    first = np.arange(max(sound - kept // 2, 0), sound) if sound < n - kept else np.arange(0)
    chosen = np.concatenate([first, np.arange(n - kept, n)])
    rows = _rows(recent, chosen.astype(int))
    behind = np.arange(len(chosen)) >= len(first)
    return replace(rows, segment=np.where(behind, rows.segment.max() + 1, rows.segment))


def _rows(recent: Recording, chosen: np.ndarray) -> Recording:
    return replace(
        recent,
        time=recent.time[chosen],
        values={name: column[chosen] for name, column in recent.values.items()},
        segment=recent.segment[chosen],
    )
