"""A row of the table: ours beside a peer's, and what is the same in both."""

import gc
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Row:
    """Ours and a peer's CPU time, s, for the same piece of work.

    Attributes
    ----------
    key : name in the JSON form, without spaces.
    same, differs : what is equal in both, and what is not.
    """

    key: str
    what: str
    peer: str
    ours: float
    theirs: float
    same: str
    differs: str

    @property
    def ratio(self) -> float:
        """Above 1 where ours is faster."""
        return self.theirs / self.ours


def median(call: Callable[[], object], rounds: int = 5) -> float:
    """CPU time of a call, s: the median of some, behind one that warms up."""
    call()
    return statistics.median(times(call, rounds))


def least(call: Callable[[], object], rounds: int = 1) -> float:
    """CPU time of the quickest call, s: others on the machine make it longer, never shorter."""
    return min(times(call, rounds))


def times(call: Callable[[], object], rounds: int) -> list[float]:
    """CPU time of each of some calls, s."""
    found = []
    for _ in range(rounds):
        gc.collect()
        begin = time.process_time()
        call()
        found.append(time.process_time() - begin)
    return found
