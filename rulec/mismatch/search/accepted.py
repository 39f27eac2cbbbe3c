"""An explanation that the final model has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rulec.effects.candidate import Candidate
from rulec.mismatch.result import Rival
from rulec.mismatch.search.curve_found import CurveFound

Odds = tuple[tuple[Candidate, float], ...]
"""Other explanations in the place of one, and their odds against it."""


@dataclass(frozen=True)
class Accepted:
    """An explanation that the final model has: its own gain, and the odds of others instead.

    `unnamed` are the odds of what has no name, and of nothing. `curve` tells what it is over its
    driver, where it has no name. `same` are those of `others`, by id, that coincide with it: they
    predict the very same; with the values at which they do, SI by id. `shapeless` are the odds of
    curves without a name that hold it as a special case, so that it may be one of them. `inexact`
    is the probability that no more than errors of laws and sensors is seen.
    """

    candidate: Candidate
    gain: float
    others: Odds
    rivals: tuple[Rival, ...]
    unnamed: float = 0.0
    shapeless: float = 0.0
    inexact: float = 0.0
    curve: CurveFound | None = None
    same: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def probability(self) -> float:
        """Against all others that would do, and against what has no name, or nothing."""
        others = sum(odds for _, odds in self.others)
        return (1.0 - self.inexact) / (1.0 + self.unnamed + self.shapeless + others)

    @property
    def class_probability(self) -> float:
        """That it is this one or one that shows the same."""
        same = sum(odds for candidate, odds in self.others if candidate.id in self.same)
        return self.probability * (1.0 + same + self.shapeless)
