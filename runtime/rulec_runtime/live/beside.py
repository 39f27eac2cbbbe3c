"""Looks at everything beside the rows: while one goes on, rows are judged by a partial update.

A look judges the rows that had come when it began. When it has ended, what it found is what
partial updates go on from: parts that moved since get one, and so do those that got one meanwhile.
Only that is told, so a look never takes back what later rows showed.

A partial update at a large part takes about as long as a look, so such a part gets another look
instead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import limits
from rulec_runtime.live.last_evaluation import LastEvaluation, PendingUpdate
from rulec_runtime.live.levels import far_after
from rulec_runtime.live.memory import Memory


class BackgroundUpdates(Protocol):
    """Where looks at everything go on beside the rows."""

    def begin(self, ruleset: Ruleset, memory: Memory, headers: bool) -> PendingUpdate:
        """Begin to look at all that is remembered; `headers` as in `looked`."""


@dataclass(frozen=True)
class Due:
    """What rows ask for: places of the parts that get a partial update, whether a look is due for
    the others, and whether that is one at the sensors."""

    places: list[int]
    look: bool
    doubt: bool


def parts_due(known: LastEvaluation, memory: Memory, new: int) -> tuple[LastEvaluation, Due]:
    """What is known, with readings as of the last row, and what the last rows ask for."""
    levels, flags, odd = known.levels.after_rows(memory.recent, new, far_after(known.count))
    moved, due, large = known.moved(flags), known.due(memory.count), known.large
    way, spare = memory.under_way, list[int]()
    partly = moved - large
    if way is not None and memory.count - way.count >= limits.PATIENCE:
        partly = moved
    elif way is None:
        # What is due though nothing of it moved, a look under way sees as well.
        spare = sorted(due - moved - large, key=lambda i: known.parts[i].due)[: limits.DUE_AT_ONCE]
    asked = Due(
        places=sorted(partly.union(spare)),
        look=bool((moved - partly) | (due & large)),
        doubt=odd,
    )
    return replace(known, levels=levels), asked
