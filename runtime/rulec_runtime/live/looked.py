"""What a look at everything found, and a look that is under way."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Protocol

from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.live.history import History
from rulec_runtime.live.last_evaluation import Known


@dataclass(frozen=True, kw_only=True)
class Looked:
    """What a look at everything found.

    Attributes
    ----------
    diagnosis : what is to be told.
    settled : time of the last settled row, s; None where nothing settled.
    known : what partial updates go on from; None where rows get looks alone.
    cut : rows there is no room for: so many at the beginning become operating points.
    before : operating points of the rows before all others then.
    """

    diagnosis: Diagnosis
    settled: float | None
    known: Known | None
    cut: int
    before: History | None


class Asked(Protocol):
    """A look at everything that goes on elsewhere."""

    def found(self, wait: bool) -> Looked | None:
        """What it found; None while it goes on, unless it is to be waited for. What the look
        raised is raised here."""

    def drop(self) -> None:
        """Nobody needs it any more."""


@dataclass(frozen=True, kw_only=True)
class UnderWay:
    """A look at the rows that had come when it began, while others come.

    Attributes
    ----------
    asked : the look.
    count : rows that had come; `kept` is how many of them were remembered.
    seen : places of the parts that got a partial update since.
    doubt : whether a sensor came into doubt since, so that another look is due.
    """

    asked: Asked
    count: int
    kept: int
    seen: frozenset[int] = frozenset()
    doubt: bool = False

    def with_seen(self, places: Collection[int]) -> UnderWay:
        """The same when some parts have got a partial update."""
        return replace(self, seen=self.seen.union(places))

    def doubted(self, doubt: bool) -> UnderWay:
        """The same after rows that may have put a sensor in doubt."""
        return replace(self, doubt=self.doubt or doubt)
