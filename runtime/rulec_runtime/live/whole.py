"""A look at everything that is remembered, as a function of it alone: it may be done elsewhere."""

from __future__ import annotations

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors.conditions import SWAPPED, UNIT
from rulec_runtime.live import limits
from rulec_runtime.live.condensed_history import oldest
from rulec_runtime.live.full_update import look
from rulec_runtime.live.last_evaluation import known_after
from rulec_runtime.live.looked import Looked
from rulec_runtime.live.memory import Memory


def looked(ruleset: Ruleset, memory: Memory, headers: bool = True) -> Looked:
    """Judge all that is remembered of a plant that settles, and what there is no room for.

    Without `headers` a column is what its header says, unless something else has been told.
    """
    recent = memory.recent
    headers = _is_misread(memory) or (headers and memory.before is None)
    diagnosis, judged = look(ruleset, recent, memory.before, headers=headers)
    known = None
    if judged is not None and _is_large(memory):
        known = known_after(ruleset, diagnosis, judged, memory.count)
    cut, before = 0, memory.before
    if len(recent) >= 2 * limits.KEPT_ROWS:
        cut, before = oldest(memory, judged, diagnosis)
    return Looked(
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
