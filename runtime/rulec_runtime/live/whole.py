"""A full update as a function of memory alone, so that another process can run it.

When memory is full, the older half of the rows becomes operating points.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.sensors.conditions import SWAPPED, UNIT
from rulec_runtime.live import limits
from rulec_runtime.live.full_update import FullUpdate, full_update
from rulec_runtime.live.history import History, some
from rulec_runtime.live.last_evaluation import Evaluation, evaluation_after
from rulec_runtime.live.memory import Memory


def evaluated(ruleset: Ruleset, memory: Memory, headers: bool = True) -> Evaluation:
    """Judge the whole memory of a plant that settles, and find the rows that exceed it.

    Without `headers`, headers are only checked if a column has already been reported to differ from
    its header.
    """
    recent = memory.recent
    # Apart from that, only the first rows are checked: later a lasting fault looks the same.
    conditions = {e.subject.rpartition(".")[2] for e in memory.episodes if e.kind == "sensor"}
    misread = bool(conditions & {UNIT.name, SWAPPED.name})
    headers = misread or (headers and memory.before is None)
    diagnosis, judged = full_update(ruleset, recent, memory.before, headers=headers)
    known = None
    signals = len(recent.values)
    # Only if a full update takes longer than until the next row.
    large = signals > limits.SMALL_PLANT or signals * len(recent) > limits.SEEN_AT_ONCE
    if judged is not None and large:
        known = evaluation_after(ruleset, diagnosis, judged, memory.count)
    cut, before = 0, memory.before
    if len(recent) >= 2 * limits.KEPT_ROWS:
        cut, before = _oldest(memory, judged, diagnosis)
    return Evaluation(
        diagnosis=diagnosis,
        settled=None if judged is None else float(judged.whole.timeline.until[-1]),
        known=known,
        cut=cut,
        before=before,
    )


def _oldest(
    memory: Memory, judged: FullUpdate | None, diagnosis: Diagnosis
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


def _over(judged: FullUpdate, diagnosis: Diagnosis) -> np.ndarray:
    """Flags of points of faults that have ended, shape (n,); they are no reference."""
    timeline = judged.whole.timeline
    over: np.ndarray = np.any([part.isolation.deviating for part in judged.seen], axis=0)
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
