"""A look at everything that is remembered, as a function of it alone: it may be done elsewhere.

Of rows for which there is no room, the older half becomes operating points.
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
    """Judge all that is remembered of a plant that settles, and what there is no room for.

    Without `headers` a column is what its header says, unless something else has been told.
    """
    recent = memory.recent
    headers = _is_misread(memory) or (headers and memory.before is None)
    diagnosis, judged = full_update(ruleset, recent, memory.before, headers=headers)
    known = None
    if judged is not None and _is_large(memory):
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


def _is_misread(memory: Memory) -> bool:
    """Has a column been told to be another than its header says?

    Besides, only the first rows are asked: later a fault that lasts looks like it.
    """
    misread = {UNIT.name, SWAPPED.name}
    told = (one.subject.rpartition(".")[2] for one in memory.episodes if one.kind == "sensor")
    return bool(misread.intersection(told))


def _is_large(memory: Memory) -> bool:
    """Does a look at everything take longer than until the next row?"""
    signals = len(memory.recent.values)
    numbers = signals * len(memory.recent)
    return signals > limits.SMALL_PLANT or numbers > limits.SEEN_AT_ONCE


def _oldest(
    memory: Memory, judged: FullUpdate | None, diagnosis: Diagnosis
) -> tuple[int, History | None]:
    """How many rows of a plant that settles there is no room for, and the operating points of all
    that are before the others then."""
    recent = memory.recent
    cut = len(recent) - limits.KEPT_ROWS
    if judged is None:
        return cut, memory.before
    # A stretch that goes on behind the cut stays whole.
    firsts = judged.stretches.first
    cut = int(firsts[firsts >= cut][0]) if (firsts >= cut).any() else cut
    gone = np.ones(len(judged.whole), dtype=bool)
    gone[len(gone) - len(firsts) :] = judged.stretches.last <= cut
    gone &= ~_over(judged, diagnosis)
    before = _thinned(some(judged.whole, gone))
    timeline = replace(before.timeline, later=before.timeline.later - (len(recent) - cut))
    return cut, replace(before, timeline=timeline)


def _over(judged: FullUpdate, diagnosis: Diagnosis) -> np.ndarray:
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
