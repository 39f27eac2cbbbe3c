"""Candidates as columns: slopes of the residuals by one amplitude, all else of it held."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, Unknown
from rulec.mismatch.evidence.configuration import Configuration, Course

Names = frozenset[str]
"""Names of candidates, with marks for those that begin, come and go or grow, and of terms."""

COMES, GROWS = "!", "/"
"""Marks after the id of a candidate that begins or comes and goes, and of one that grows."""


def marked(id_: str, course: Course | None) -> str:
    """The id of a candidate, marked where it begins, comes and goes, or grows."""
    if course is None:
        return id_
    return id_ + (GROWS if course.grows else COMES)


def name_of(setting: Configuration, candidate: Candidate) -> str:
    """The marked id of a joined candidate."""
    own = {u.id for u in candidate.unknowns}
    return marked(candidate.id, next((c for c in setting.courses if c.unknown in own), None))


def id_of(name: str) -> str:
    """The id of a candidate by its name, without marks."""
    return name.rstrip(COMES + GROWS)


@dataclass(frozen=True, kw_only=True)
class Column:
    """One amplitude of a candidate with its other unknowns held; `rows` are its slopes.

    `course` is that of a fault that begins, grows, or comes and goes.
    """

    candidate: Candidate
    amplitude: Unknown
    values: dict[str, float]
    fixed: dict[str, float]
    rows: Array
    course: Course | None = None

    @property
    def name(self) -> str:
        """The marked id of the candidate."""
        return marked(self.candidate.id, self.course)


@dataclass(frozen=True)
class Proposal:
    """Columns that may be joined together, each with the amplitude from which to start a refit, and
    their gain in log odds."""

    gain: float
    starts: tuple[tuple[Column, float], ...]

    @property
    def names(self) -> Names:
        """Names of the columns."""
        return frozenset(column.name for column, _ in self.starts)

    @property
    def shapes(self) -> frozenset[tuple[str, frozenset[tuple[str, float]]]]:
        """Names of the columns, each with the values at which it was made."""
        return frozenset((c.name, frozenset(c.values.items())) for c, _ in self.starts)

    def joined_to(self, setting: Configuration) -> Configuration:
        """Join the columns to a setting."""
        for column, value in self.starts:
            candidate, name = column.candidate, column.amplitude.id
            if candidate.id in {c.id for c in setting.joined}:
                setting = replace(setting, values={**setting.values, name: value})
            else:
                own = {**column.values, name if column.course is None else f"{name}#0": value}
                setting = setting.joining(candidate, own, column.fixed, column.course)
        return setting


def amplitudes_of(candidate: Candidate) -> dict[Unknown, float]:
    """Amplitudes of a candidate with their nulls."""
    return {u: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}
