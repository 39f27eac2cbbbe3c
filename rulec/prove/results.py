"""A run of the proof as data and as JSON: every judged case, and how the run was made."""

import dataclasses
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

from rulec.prove.truth.sealed import plain_form

RUN, COVERED = "run", "covered"
"""The plant was run again: to distinguish explanations, or only to cover the allowed range."""

RECIPE, SAME, RANDOM = "recipe", "same", "random"

ARMS = {
    RECIPE: "as proposed",
    SAME: "the same inputs again, from the beginning of the first recording on",
    RANDOM: "as many steps, drawn within what may be set",
}
"""Ways to run the plant again, in words; all but the first are baselines."""

Score = float | None
"""0 is wrong, 1 is right; None if the score does not apply to the case."""


@dataclass(frozen=True)
class Claim:
    """A name in an answer: its reported probability, and whether it is right."""

    probability: float
    right: bool


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A case, the tool's answer, and the scores of that answer.

    Attributes
    ----------
    planted : names of effects in the truth; none on a clean case
    places : `module.place` that are right
    said : effects in the tool's answer, as `entry@module.place`
    gain : expected gain in log likelihood of the true model over the plain one: the strength
    name_right : share of names that are right; each of n candidates counts 1/n
    claims : all names in the answer, also those with alternatives
    unnamed_right : an effect without an entry is reported unnamed, at its place
    told_right : a fault or sensor error is distinguished from physics
    inside : number of intervals of parameters that contain the truth, and of all intervals
    error : why the tool gave no answer; empty if it gave one
    """

    case: str
    verdict_true: str
    verdict: str
    planted: tuple[str, ...]
    places: tuple[str, ...]
    said: tuple[str, ...]
    gain: float
    place_right: Score = None
    name_right: Score = None
    clean_right: Score = None
    unnamed_right: Score = None
    told_right: bool | None = None
    inside: tuple[int, int] = (0, 0)
    seconds: float = 0.0
    error: str = ""
    claims: tuple[Claim, ...] = ()

    @property
    def clean(self) -> bool:
        """Whether nothing is planted."""
        return not self.planted


@dataclass(frozen=True, kw_only=True)
class Further:
    """What a second recording of a case changed.

    Attributes
    ----------
    outcome : `run`; `covered`: run with steps that only cover the allowed range; `alike`: the
        recipe has no step; `refused`: the tool plans nothing; `stalled`: the plant cannot be run
        as proposed
    expected : the recipe's probability of the true explanation before and after; empty if the
        recipe only covers
    sure_before : probability of the true explanation in the first answer
    sure : the same with a second recording, by arm
    after : judged answers with a second recording, by arm; the first one if the plant stalled
    """

    case: str
    outcome: str
    why: str = ""
    expected: tuple[float, ...] = ()
    sure_before: float = 0.0
    sure: Mapping[str, float] = field(default_factory=dict)
    after: Mapping[str, Judged] = field(default_factory=dict)


@dataclass(frozen=True)
class Run:
    """All cases of a run, and how it was made.

    Attributes
    ----------
    partition : `development`, to improve the tool with; `final`, opened once to measure it
    seed : of the cases
    openings : how often the final partition was opened, this time included
    digest : hash over all sealed answers, shown before the first analysis
    version : of the tool
    seconds : duration of the whole run
    further : of each case, what a second recording changed; empty in a run of one round
    """

    judged: tuple[Judged, ...]
    _: KW_ONLY
    partition: str = "development"
    seed: int = 0
    openings: int = 0
    digest: str = ""
    version: str = ""
    seconds: float = 0.0
    notes: tuple[str, ...] = ()
    further: tuple[Further, ...] = ()

    def form(self) -> dict[str, Any]:
        """Return the machine form; infinite and undefined numbers are strings."""
        fields = dataclasses.asdict(self)
        return {name: plain_form(value, float) for name, value in fields.items()}
