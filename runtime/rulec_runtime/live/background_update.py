"""Full updates in the background: meanwhile, partial updates judge the rows.

A full update judges the rows that had come when it began, and later partial updates start from its
result. Before it is reported, all parts that have moved since or had a partial update get one
again, so a full update never withdraws what later rows showed.

A partial update of a large part takes about as long as a full one, so such a part gets another full
update instead.
"""

from dataclasses import dataclass, replace
from typing import Protocol

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import limits
from rulec_runtime.live.last_evaluation import LastEvaluation, PendingUpdate
from rulec_runtime.live.levels import far_after
from rulec_runtime.live.memory import Memory


class BackgroundUpdates(Protocol):
    """Runs full updates in the background."""

    def begin(self, ruleset: Ruleset, memory: Memory, headers: bool) -> PendingUpdate:
        """Start a full update of the memory; `headers` as in `evaluated`."""


@dataclass(frozen=True)
class Due:
    """Updates that new rows require: indices of the parts that get a partial update, whether the
    others need a full update, and whether a sensor is in doubt."""

    places: list[int]
    full: bool
    doubt: bool


def parts_due(known: LastEvaluation, memory: Memory, new: int) -> tuple[LastEvaluation, Due]:
    """The evaluation with the levels after the `new` last rows, and the updates they require."""
    levels, flags, odd = known.levels.after_rows(memory.recent, new, far_after(known.count))
    moved, due, large = known.moved(flags), known.due(memory.count), known.large
    running, spare = memory.under_way, list[int]()
    partly = moved - large
    if running is not None and memory.count - running.count >= limits.PATIENCE:
        partly = moved
    elif running is None:
        # A running full update covers the parts that are due without having moved.
        spare = sorted(due - moved - large, key=lambda i: known.parts[i].due)[: limits.DUE_AT_ONCE]
    full = bool((moved - partly) | (due & large))
    return replace(known, levels=levels), Due(sorted(partly.union(spare)), full, doubt=odd)
