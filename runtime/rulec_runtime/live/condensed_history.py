"""Rows for which there is no room: the older half of them becomes operating points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.live import limits
from rulec_runtime.live.episode import Episode
from rulec_runtime.live.full_update import Judged
from rulec_runtime.live.history import History, some
from rulec_runtime.live.memory import Memory
from rulec_runtime.recordings.recording import Recording


def oldest(
    memory: Memory, judged: Judged | None, diagnosis: Diagnosis
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


def without_first(recent: Recording, cut: int) -> Recording:
    """The rows from a number on."""
    return _rows(recent, np.arange(cut, len(recent))) if cut else recent


def _over(judged: Judged, diagnosis: Diagnosis) -> np.ndarray:
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


def reference_and_latest(recent: Recording, episodes: tuple[Episode, ...]) -> Recording:
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
