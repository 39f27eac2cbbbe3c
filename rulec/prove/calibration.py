"""Are probabilities what they say? Of names told with a probability, the share that is right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from rulec.prove.limits import PROBABILITIES
from rulec.prove.results import Judged
from rulec.prove.scores import wilson


@dataclass(frozen=True)
class Reliability:
    """Names told with a probability from `low` to `high`, the upper end included at 1 only.

    Attributes
    ----------
    said : mean probability, the share that should be right
    count, right : how many, and how many of them are right
    ends : 95 % interval of the share that is right
    """

    low: float
    high: float
    said: float
    count: int
    right: int
    ends: tuple[float, float]

    @property
    def share(self) -> float:
        """Of right names."""
        return self.right / self.count

    @property
    def words(self) -> str:
        """Whether the interval holds what was said."""
        low, high = self.ends
        return "as said" if low <= self.said <= high else "too sure" if high < self.said else "shy"


def reliability(judged: Sequence[Judged]) -> list[Reliability]:
    """All names in the answers by their probability; bins with names only."""
    claims = [claim for j in judged for claim in j.claims]
    found = []
    for low, high in pairwise(PROBABILITIES):
        own = [c for c in claims if low <= c.probability < high or c.probability == high == 1.0]
        if own:
            right, said = sum(c.right for c in own), sum(c.probability for c in own) / len(own)
            found.append(Reliability(low, high, said, len(own), right, wilson(right, len(own))))
    return found
