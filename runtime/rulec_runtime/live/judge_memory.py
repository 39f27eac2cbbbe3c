"""Judge all rows and operating points in memory with the passes of a recording.

When memory is full, the older half of the rows becomes operating points.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, assembled, diagnose, judged_parts, restless
from rulec_runtime.diagnosis.sensors.conditions import STUCK, SWAPPED, UNIT
from rulec_runtime.diagnosis.sensors.sensor_health import examine
from rulec_runtime.diagnosis.steady.evaluated_points import (
    EvaluatedPoints,
    evaluate_points,
    judgeable,
)
from rulec_runtime.diagnosis.steady.events import events_of
from rulec_runtime.diagnosis.steady.findings import Found, Period
from rulec_runtime.live import limits
from rulec_runtime.live.history import History, history_of, joined, some
from rulec_runtime.live.memory import Memory, without_first
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Stretches, Timeline


def judged_memory(ruleset: Ruleset, memory: Memory) -> tuple[Diagnosis, float | None, Memory]:
    """The diagnosis of the memory, the time of the last settled row, s, and memory without the rows
    that exceed it. The time is None for a plant that stores, and if nothing settled.

    Later than the first rows, headers are only checked if a column has already been reported to
    differ from its header: a lasting fault looks the same.
    """
    recent, before = memory.recent, memory.before
    if ruleset.dynamics is not None:
        return diagnose(recent, ruleset), None, memory
    conditions = {e.subject.rpartition(".")[2] for e in memory.episodes if e.kind == "sensor"}
    headers = before is None or bool(conditions & {UNIT.name, SWAPPED.name})
    stuck = {
        e.subject.rpartition(".")[0]: e.since
        for e in memory.episodes
        if e.active and e.kind == "sensor" and e.subject.endswith(f".{STUCK.name}")
    }
    health = examine(recent, ruleset, headers=headers, stuck_since=stuck)
    recording = health.recording
    stretches, noise = judgeable(recording, ruleset, "default")
    whole = history_of(recording, ruleset, stretches, noise)
    if before is not None:
        whole = joined(before, recording, whole)
    if not len(whole):
        since, until = float(recording.time[0]), float(recording.time[-1])
        found = Found([], [], [Period(since, until, restless(len(recording)))])
        diagnosis = assembled(health, ruleset, "default", judged=0, found=found)
        return diagnosis, None, _bounded(memory, whole, stretches, np.zeros(0, dtype=bool))
    evaluated = evaluate_points(ruleset, whole.points, whole.halves, "default")
    samples, found = judged_parts(ruleset, whole.timeline, evaluated)
    dropped = len(whole) - len(stretches)
    events = events_of(recording, ruleset, stretches, noise, evaluated, "default", dropped)
    found.findings.extend(events)
    found.not_judged.extend(_unsettled(recording, whole))
    diagnosis = assembled(health, ruleset, "default", judged=samples, found=found)
    over = _over(whole.timeline, evaluated, diagnosis)
    settled = float(whole.timeline.until[-1])
    return diagnosis, settled, _bounded(memory, whole, stretches, over)


def _bounded(memory: Memory, whole: History, stretches: Stretches, over: np.ndarray) -> Memory:
    """Memory whose older rows have become operating points, if it is full; `over` flags points that
    are no reference, shape (points,)."""
    recent = memory.recent
    if len(recent) < 2 * limits.KEPT_ROWS:
        return memory
    cut = len(recent) - limits.KEPT_ROWS
    if not len(whole):
        return replace(memory, recent=without_first(recent, cut))
    # A stretch that continues after the cut stays whole.
    firsts = stretches.first
    cut = int(firsts[firsts >= cut][0]) if (firsts >= cut).any() else cut
    gone = np.ones(len(whole), dtype=bool)
    gone[len(gone) - len(firsts) :] = stretches.last <= cut
    before = _thinned(some(whole, gone & ~over))
    later = before.timeline.later - (len(recent) - cut)
    before = replace(before, timeline=replace(before.timeline, later=later))
    return replace(memory, recent=without_first(recent, cut), before=before)


def _over(timeline: Timeline, evaluated: list[EvaluatedPoints], diagnosis: Diagnosis) -> np.ndarray:
    """Flags of points of faults that have ended, shape (n,); they are no reference."""
    over: np.ndarray = np.any([part.isolation.deviating for part in evaluated], axis=0)
    for finding in diagnosis.findings:
        if finding.active:
            over &= (timeline.until < finding.since) | (timeline.since > finding.until)
    over[-1:] = False
    return over


def _thinned(history: History) -> History:
    """Drop every second point of the older half while there are too many."""
    while len(history) > limits.MOST_POINTS:
        keep = np.ones(len(history), dtype=bool)
        keep[1 : len(history) // 2 : 2] = False
        history = some(history, keep)
    return history


def _unsettled(recording: Recording, whole: History) -> Iterator[Period]:
    """Rows after the last stretch, if there are too many for a move to an operating point."""
    rows = int(whole.timeline.later[-1])
    if rows >= limits.BLIND_ROWS:
        text = "the plant does not settle: readings jump or move too fast"
        first = max(len(recording) - rows, 0)
        yield Period(float(recording.time[first]), float(recording.time[-1]), text)
