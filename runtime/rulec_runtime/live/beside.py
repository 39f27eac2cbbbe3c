"""Looks at everything beside the rows: while one goes on, rows are judged at a glance.

A look judges the rows that had come when it began. When it has ended, what it found is what
glances go on from: parts that moved since get one, and so do those that got one meanwhile. Only
that is told, so a look never takes back what later rows showed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import limits
from rulec_runtime.live.known import Known
from rulec_runtime.live.looked import Asked, UnderWay
from rulec_runtime.live.memory import Memory


class Looks(Protocol):
    """Where looks at everything go on beside the rows."""

    def begin(self, ruleset: Ruleset, memory: Memory) -> Asked:
        """Begin to look at all that is remembered."""


def caught_up_with(memory: Memory, known: Known, way: UnderWay) -> tuple[Known, list[int], bool]:
    """What a look found, with readings as of the last row; places of the parts that are to get a
    glance; and whether a sensor is in doubt by rows that the look has not seen."""
    levels, moved, odd = known.levels.after_rows(memory.recent, memory.count - way.count)
    places = way.seen.union(known.to_be_seen(moved, memory.count, limits.DUE_AT_ONCE))
    return replace(known, levels=levels), sorted(places), odd
