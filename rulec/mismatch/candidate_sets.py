"""What a comparison left standing: `rulec experiment` reads it without all the rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Presence:
    """When something is there: of an unknown the periods, s, each with the number of its level, and
    whether it grows from nothing in the last one."""

    unknown: str
    spans: tuple[tuple[float, float, int], ...]
    grows: bool


@dataclass(frozen=True, kw_only=True)
class CandidateSet:
    """A set of explanations that is still possible.

    `names` are those of the search, `titles` the same in words; without any nothing is left out.
    The rest is where it was fitted, SI: ids of what is `joined`, `values` and `fixed` numbers by
    id, `periods`, and per term without a name its name and the share of its driver's range over
    which it is alike.
    """

    names: tuple[str, ...]
    titles: tuple[str, ...]
    probability: float
    joined: tuple[str, ...]
    values: Mapping[str, float]
    fixed: Mapping[str, float]
    periods: tuple[Presence, ...]
    terms: tuple[tuple[str, float], ...]
