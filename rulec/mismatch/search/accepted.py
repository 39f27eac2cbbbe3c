"""An explanation in the final model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rulec.effects.candidate import Candidate
from rulec.mismatch.result import Rival
from rulec.mismatch.search.curve_found import CurveFound


@dataclass(frozen=True)
class Accepted:
    """An explanation in the final model, its gain, and the odds of alternatives against it.

    `others` are explanations in its place, each with its odds. `unnamed` are the odds of terms
    without a name, and of nothing; `shapeless` those of curves without a name that contain its law
    as a special case. `curve` describes an explanation without a name. `same` holds, by id, those
    of `others` that predict exactly the same, with the values at which they do, SI by id. `inexact`
    is the probability that errors of laws and sensors alone explain the misfit.
    """

    candidate: Candidate
    gain: float
    others: tuple[tuple[Candidate, float], ...]
    rivals: tuple[Rival, ...]
    unnamed: float = 0.0
    shapeless: float = 0.0
    inexact: float = 0.0
    curve: CurveFound | None = None
    same: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def probability(self) -> float:
        """Against all alternatives, terms without a name and nothing."""
        others = sum(odds for _, odds in self.others)
        return (1.0 - self.inexact) / (1.0 + self.unnamed + self.shapeless + others)

    @property
    def class_probability(self) -> float:
        """Of this explanation or one that shows the same."""
        same = sum(odds for candidate, odds in self.others if candidate.id in self.same)
        return self.probability * (1.0 + same + self.shapeless)
