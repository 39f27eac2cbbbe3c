"""A full update: the passes of a recording, over all rows and operating points in memory.

When memory is full, the older half of the rows becomes operating points.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, assembled, restless, together
from rulec_runtime.diagnosis.sensors.conditions import SWAPPED, UNIT
from rulec_runtime.diagnosis.sensors.sensor_health import Health, examine
from rulec_runtime.diagnosis.steady.evaluated_points import (
    EvaluatedPoints,
    evaluate_points,
    judgeable,
)
from rulec_runtime.diagnosis.steady.findings import Found, Period
from rulec_runtime.diagnosis.steady.growing_faults import found_of
from rulec_runtime.diagnosis.steady.independent_parts import parts_of
from rulec_runtime.live import limits
from rulec_runtime.live.changes import Horizon
from rulec_runtime.live.history import History, history_of, joined, some
from rulec_runtime.live.last_evaluation import LastEvaluation, PartEvaluation, due_after
from rulec_runtime.live.levels import levels_of
from rulec_runtime.live.memory import Memory, without_first
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Stretches


@dataclass(frozen=True, kw_only=True)
class _FullUpdate:
    """The result of the passes.

    Attributes
    ----------
    whole : all operating points in memory.
    stretches : settled stretches of the latest rows; `noise` of readings within them, SI.
    health : of the sensors.
    evaluated_parts, found : per part of the plant, the evaluated points and the findings.
    """

    whole: History
    stretches: Stretches
    noise: Mapping[str, float]
    health: Health
    evaluated_parts: tuple[EvaluatedPoints, ...]
    found: tuple[Found, ...]


def evaluated(ruleset: Ruleset, memory: Memory) -> tuple[Diagnosis, float | None, Memory]:
    """Judge the whole memory of a plant that settles: the diagnosis, the time of the last settled
    row, s (None if nothing settled), and memory without the rows that exceed it.

    Later than the first rows, headers are only checked if a column has already been reported to
    differ from its header: a lasting fault looks the same.
    """
    recent = memory.recent
    conditions = {e.subject.rpartition(".")[2] for e in memory.episodes if e.kind == "sensor"}
    headers = memory.before is None or bool(conditions & {UNIT.name, SWAPPED.name})
    diagnosis, judged = _full_update(ruleset, recent, memory.before, headers=headers)
    known = None
    signals = len(recent.values)
    # Only if a full update takes longer than until the next row.
    large = signals > limits.SMALL_PLANT or signals * len(recent) > limits.SEEN_AT_ONCE
    if judged is not None and large:
        known = _evaluation_after(ruleset, diagnosis, judged, memory.count)
    after = replace(memory, known=known)
    if len(recent) >= 2 * limits.KEPT_ROWS:
        cut, before = _oldest(memory, judged, diagnosis)
        after = replace(after, recent=without_first(recent, cut), before=before)
    settled = None if judged is None else float(judged.whole.timeline.until[-1])
    return diagnosis, settled, after


def _full_update(
    ruleset: Ruleset, recent: Recording, before: History | None, *, headers: bool
) -> tuple[Diagnosis, _FullUpdate | None]:
    """Judge a plant that settles by the whole memory; no `_FullUpdate` if nothing settled.

    `headers`: whether to check for columns that do not match their headers.
    """
    health = examine(recent, ruleset, headers=headers)
    recording = health.recording
    stretches, noise = judgeable(recording, ruleset, "default")
    own = history_of(recording, ruleset, stretches, noise)
    whole = own if before is None else joined(before, recording, own)
    if not len(whole):
        since, until = float(recording.time[0]), float(recording.time[-1])
        found = Found([], [], [Period(since, until, restless(len(recording)))])
        return assembled(health, ruleset, "default", judged=0, found=found), None
    evaluated_parts = evaluate_points(ruleset, whole.points, whole.halves, "default")
    each = tuple(found_of(whole.timeline, ruleset, part) for part in evaluated_parts)
    samples, found = together(ruleset, whole.timeline, evaluated_parts, each)
    found.not_judged.extend(unsettled(recording, whole))
    diagnosis = assembled(health, ruleset, "default", judged=samples, found=found)
    return diagnosis, _FullUpdate(
        whole=whole,
        stretches=stretches,
        noise=noise,
        health=health,
        evaluated_parts=tuple(evaluated_parts),
        found=each,
    )


def _evaluation_after(
    ruleset: Ruleset, diagnosis: Diagnosis, judged: _FullUpdate, count: int
) -> LastEvaluation:
    """The evaluation after a full update with row number `count`."""
    recording, whole = judged.health.recording, judged.whole
    settled = float(whole.timeline.until[-1])
    parts = tuple(
        PartEvaluation(
            part=part,
            found=found,
            settled=settled,
            due=due_after(whole, count),
        )
        for part, found in zip(parts_of(ruleset), judged.found, strict=True)
    )
    # A copy drops the cached properties of the recording, which nobody needs again.
    health = replace(judged.health, recording=replace(recording))
    return LastEvaluation(
        diagnosis=diagnosis,
        health=health,
        noise=judged.noise,
        count=count,
        parts=parts,
        levels=levels_of(ruleset, recording, judged.noise).judged(whole),
    )


def _oldest(
    memory: Memory, judged: _FullUpdate | None, diagnosis: Diagnosis
) -> tuple[int, History | None]:
    """How many rows exceed memory, and the operating points of all rows before the others."""
    recent = memory.recent
    cut = len(recent) - limits.KEPT_ROWS
    if judged is None:
        return cut, memory.before
    # A stretch that continues after the cut stays whole.
    firsts = judged.stretches.first
    cut = int(firsts[firsts >= cut][0]) if (firsts >= cut).any() else cut
    gone = np.ones(len(judged.whole), dtype=bool)
    gone[len(gone) - len(firsts) :] = judged.stretches.last <= cut
    gone &= ~_over(judged, diagnosis)
    before = _thinned(some(judged.whole, gone))
    timeline = replace(before.timeline, later=before.timeline.later - (len(recent) - cut))
    return cut, replace(before, timeline=timeline)


def _over(judged: _FullUpdate, diagnosis: Diagnosis) -> np.ndarray:
    """Flags of points of faults that have ended, shape (n,); they are no reference."""
    timeline = judged.whole.timeline
    over: np.ndarray = np.any([part.isolation.deviating for part in judged.evaluated_parts], axis=0)
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


def unsettled(recording: Recording, whole: History) -> Iterator[Period]:
    """Rows after the last stretch, if there are too many for a move to an operating point."""
    rows = int(whole.timeline.later[-1])
    if rows >= limits.BLIND_ROWS:
        text = "the plant does not settle: readings jump or move too fast"
        first = max(len(recording) - rows, 0)
        yield Period(float(recording.time[first]), float(recording.time[-1]), text)


def horizon_of(time: Array, settled: float | None) -> Horizon:
    """The horizon of a diagnosis of rows at these times, s, shape (n,); `settled` is the time of
    the last settled row, if there is any."""
    interval = float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    return Horizon(
        since=float(time[0]),
        until=float(time[-1]),
        settled=float(time[-1]) if settled is None else settled,
        usual=limits.BLIND_ROWS * interval,
        time=time,
        pause=common.SETTLING,
    )
