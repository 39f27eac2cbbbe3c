"""Scores of judged cases against the goals, each with its count and its 95 % interval."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

from rulec_runtime.report.text import fixed, percent

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
    """One score: the number of cases (or intervals), and of right ones, which may be a fraction."""

    score: str
    goal: Goal
    count: int
    hits: float

    @property
    def share(self) -> float:
        """The score; NaN without cases."""
        return self.hits / self.count if self.count else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Its 95 % interval; NaN without cases."""
        return wilson(self.hits, self.count)

    @property
    def text(self) -> str:
        """The score in percent; a dash without cases."""
        return f"{fixed(100 * self.share, 1)} %" if self.count else "–"

    @property
    def interval_text(self) -> str:
        """The interval in percent; empty without cases."""
        low, high = self.interval
        return f"{fixed(100 * low, 1)} to {fixed(100 * high, 1)} %" if self.count else ""

    @property
    def met(self) -> bool | None:
        """Whether it reaches the goal; None without cases."""
        return self.goal.holds(self.share) if self.count else None

    @property
    def sure(self) -> bool:
        """Whether the whole interval is on the same side of the goal."""
        low, high = self.interval
        if self.met:
            return self.goal.holds(low) and self.goal.holds(high)
        return high < self.goal.low or low > self.goal.high

    @property
    def words(self) -> str:
        """`met`, `missed` or `no case`, and whether the interval leaves it in doubt."""
        if self.met is None:
            return "no case"
        return ("met" if self.met else "missed") + ("" if self.sure else ", not surely")


SHARES = {
    "place_right": "place right",
    "name_right": "name right",
    "clean_right": "clean called clean",
    "unnamed_right": "unnamed called unnamed, with its place",
    "told_right": "fault and sensor told from physics",
}
"""Titles of scores that are shares of cases, by attribute."""

TITLES = {
    **SHARES,
    "inside": "truth inside the 95 % interval",
    "false": "false names among all told as certain",
}
"""Titles of all scores by the names of their goals."""


def table(judged: Sequence[Judged]) -> list[Row]:
    """Return all scores in the order of their goals; failed cases count as they were judged."""
    claims = [claim for j in judged for claim in j.claims]
    values: dict[str, list[float | None]] = {n: [getattr(j, n) for j in judged] for n in SHARES}
    values["inside"] = [float(k < j.inside[0]) for j in judged for k in range(j.inside[1])]
    values["false"] = [float(not c.right) for c in claims if c.probability >= limits.CERTAIN]
    rows = []
    for name, title in TITLES.items():
        low, high = limits.GOALS[name]
        # The text has the ends that can be missed.
        ends = (f"{100 * end:.0f}" for end in (low, high) if end not in (0.0, 1.0))
        own = [float(v) for v in values[name] if v is not None and math.isfinite(v)]
        rows.append(Row(title, Goal(low, high, f"{'–'.join(ends)} %"), len(own), sum(own)))
    return rows


def scores_form(judged: Sequence[Judged]) -> dict[str, dict[str, float | None]]:
    """Return all scores in the machine form, by the names of their goals."""
    return {
        name: {
            "share": row.share if row.count else None,
            "count": int(row.hits) if float(row.hits).is_integer() else row.hits,
            "of": row.count,
        }
        for name, row in zip(TITLES, table(judged), strict=True)
    }


def wilson(hits: float, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a share; NaN without cases.

    Source: Wilson 1927; hits may be fractions, as an ambiguity set counts 1/size.
    """
    if not count:
        return math.nan, math.nan
    p, z = hits / count, limits.NORMAL_QUANTILE
    z2 = z**2 / count
    middle = (p + z2 / 2) / (1 + z2)
    half = z * math.sqrt(max(p * (1 - p), 0.0) / count + z2 / (4 * count)) / (1 + z2)
    return max(middle - half, 0.0), min(middle + half, 1.0)


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
        found.append(Row(title, goal, len(own), sum(c.right for c in own)))
    return found


def trust(row: Row) -> str:
    """Return whether the interval of a share of right names contains the mean probability."""
    said, (low, high) = row.goal.low, row.interval
    return "as said" if low <= said <= high else "too sure" if high < said else "shy"
