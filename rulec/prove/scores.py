"""Scores of judged cases against the goals, each with its count and its 95 % interval."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

from rulec_runtime.report.text import percent

from rulec.prove import limits
from rulec.prove.results import Judged


@dataclass(frozen=True)
class Goal:
    """An interval of values that are good enough, ends included, and its text."""

    low: float
    high: float
    text: str

    def holds(self, value: float) -> bool:
        return self.low <= value <= self.high


@dataclass(frozen=True)
class Row:
    """One score.

    Attributes
    ----------
    count, hits : number of cases (or intervals), and of right ones
    share : the score; `low` and `high` its 95 % interval; NaN without cases
    met : None without cases
    sure : whether the whole interval is on the same side of the goal
    """

    score: str
    goal: Goal
    count: int
    hits: float
    share: float
    low: float
    high: float

    @property
    def met(self) -> bool | None:
        return self.goal.holds(self.share) if self.count else None

    @property
    def sure(self) -> bool:
        if self.met:
            return self.goal.holds(self.low) and self.goal.holds(self.high)
        return self.high < self.goal.low or self.low > self.goal.high

    @property
    def words(self) -> str:
        """`met`, `missed` or `no case`, and whether the interval leaves it in doubt."""
        if self.met is None:
            return "no case"
        return ("met" if self.met else "missed") + ("" if self.sure else ", not surely")


NAN = float("nan")


def goal_of(name: str) -> Goal:
    """Return the goal of a score; its text has the ends that can be missed."""
    low, high = limits.GOALS[name]
    ends = (f"{100 * end:.0f}" for end in (low, high) if end not in (0.0, 1.0))
    return Goal(low, high, f"{'–'.join(ends)} %")


SHARES = {
    "place_right": "place right",
    "name_right": "name right",
    "clean_right": "clean called clean",
    "unnamed_right": "unnamed called unnamed, with its place",
    "told_right": "fault and sensor told from physics",
}
"""Titles of scores that are shares of cases, by attribute."""

COVERAGE = "truth inside the 95 % interval"
FALSE_NAMES = "false names among all told as certain"


def table(judged: Sequence[Judged]) -> list[Row]:
    """Return all scores in the order of their goals; failed cases count as they were judged."""
    columns = ((title, name, values_of(judged, name)) for name, title in SHARES.items())
    inside, intervals = (sum(j.inside[i] for j in judged) for i in (0, 1))
    certain = [c.right for j in judged for c in j.claims if c.probability >= limits.CERTAIN]
    return [
        *(of_hits(t, goal_of(name), len(values), sum(values)) for t, name, values in columns),
        of_hits(COVERAGE, goal_of("inside"), intervals, inside),
        of_hits(FALSE_NAMES, goal_of("false"), len(certain), certain.count(False)),
    ]


def scores_form(judged: Sequence[Judged]) -> dict[str, dict[str, float | None]]:
    """Return all scores in the machine form, by the names of their goals."""
    return {
        name: {
            "share": row.share if row.count else None,
            "count": int(row.hits) if float(row.hits).is_integer() else row.hits,
            "of": row.count,
        }
        for name, row in zip(limits.GOALS, table(judged), strict=True)
    }


def values_of(judged: Sequence[Judged], name: str) -> list[float]:
    """Return the values of an attribute, of the cases that have one."""
    values = (getattr(j, name) for j in judged)
    return [float(v) for v in values if v is not None and math.isfinite(v)]


def wilson(hits: float, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a share; NaN without cases.

    Source: Wilson 1927; hits may be fractions, as an ambiguity set counts 1/size.
    """
    if not count:
        return NAN, NAN
    p, z2 = hits / count, limits.NORMAL_QUANTILE**2 / count
    middle = (p + z2 / 2) / (1 + z2)
    half = (
        limits.NORMAL_QUANTILE
        * math.sqrt(max(p * (1 - p), 0.0) / count + z2 / (4 * count))
        / (1 + z2)
    )
    return max(middle - half, 0.0), min(middle + half, 1.0)


def of_hits(title: str, goal: Goal, count: int, hits: float) -> Row:
    """Return a share of cases with its interval."""
    low, high = wilson(hits, count)
    share = hits / count if count else NAN
    return Row(title, goal, count, hits, share, low, high)


B = TypeVar("B")


def by_probability(
    all_: Sequence[B], probability: Callable[[B], float]
) -> Iterator[tuple[float, float, list[B]]]:
    """Yield the ends of each bin of probabilities, and what is in it; bins with something only."""
    for low, high in pairwise(limits.PROBABILITIES):
        own = [b for b in all_ if low <= (p := probability(b)) < high or p == high == 1.0]
        if own:
            yield low, high, own


def reliability(judged: Sequence[Judged]) -> list[Row]:
    """Return the share of right names by the probability told, whose mean is the goal."""
    found = []
    claims = [claim for j in judged for claim in j.claims]
    for low, high, own in by_probability(claims, lambda claim: claim.probability):
        said = sum(c.probability for c in own) / len(own)
        title, goal = f"{percent(low)} to {percent(high)}", Goal(said, said, percent(said))
        found.append(of_hits(title, goal, len(own), sum(c.right for c in own)))
    return found


def trust(row: Row) -> str:
    """Return whether the interval of a share of right names contains the mean probability."""
    said = row.goal.low
    return "as said" if row.low <= said <= row.high else "too sure" if row.high < said else "shy"
