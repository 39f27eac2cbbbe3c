"""Sets of explanations that a comparison leaves possible, for `rulec experiment` to read alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Presence:
    """When something is present: the periods of an unknown, s, each with the number of its level,
    and whether it grows from zero in the last one."""

    unknown: str
    spans: tuple[tuple[float, float, int], ...]
    grows: bool


@dataclass(frozen=True, kw_only=True)
class CandidateSet:
    """A set of explanations that is still possible.

    `names` are those of the search, `titles` the same in words; both are empty if nothing is
    missing. The rest describes its fit, SI: ids of `joined` candidates, `values` and `fixed`
    numbers by id, `periods`, and per term without a name its name and its correlation length as a
    share of its driver's range.
    """

    names: tuple[str, ...]
    titles: tuple[str, ...]
    probability: float
    joined: tuple[str, ...]
    values: Mapping[str, float]
    fixed: Mapping[str, float]
    periods: tuple[Presence, ...]
    terms: tuple[tuple[str, float], ...]
