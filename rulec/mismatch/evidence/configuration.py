"""The configuration of a model: joined candidates and all values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate

ERROR = "error:"
"""Mark before the id of a signal: its systematic error, in standard uncertainties of its class."""

OF_RECORDING = "|"
"""Mark between the name of an error and the number of the only recording that has it."""


def own_error(signal: str, number: int) -> str:
    """Name of the part of a sensor's error that is specific to one of several recordings."""
    return f"{ERROR}{signal}{OF_RECORDING}{number}"


def reading_and_recording(error: str) -> tuple[str, int | None]:
    """The signal of an error, and the number of its recording if it is specific to one.

    >>> reading_and_recording("error:A.dp"), reading_and_recording("error:A.dp|1")
    (('A.dp', None), ('A.dp', 1))
    """
    signal, mark, number = error.removeprefix(ERROR).partition(OF_RECORDING)
    return signal, int(number) if mark else None


HIDDEN = "hidden"
"""Sort of candidates for an unrecorded driver: an error at a place with a free course in time."""

CHANGE = "~"
"""Mark after the id of a parameter: its change, with a free course in time."""


@dataclass(frozen=True)
class Span:
    """A period, s, and the number of its level."""

    since: float
    until: float
    level: int


@dataclass(frozen=True)
class Course:
    """An unknown that has one of a few levels in some periods, and none outside.

    `segment`, shape (n,), is the number of the level at each point, -1 outside. A smooth course is
    linear between levels: `ahead`, shape (n,), is the share of the next one. A growing course
    starts at zero and reaches its level at the end of its period: `risen`, shape (n,), is the share
    reached.
    """

    unknown: str
    segment: np.ndarray
    periods: tuple[Span, ...]
    ahead: Array | None = None
    risen: Array | None = None

    @property
    def grows(self) -> bool:
        """Does it grow in proportion to time since it began?"""
        return self.risen is not None

    def since(self, begin: float, time: Array) -> Course:
        """The same course with another onset, s, lasting to the end; `time`, s, has shape (n,)."""
        return lasting(self.unknown, begin, time, grows=self.grows)

    def at_times(self, time: Array) -> Course:
        """The same periods at other points; a course that lasts to the end does so there too."""
        segment = np.full(len(time), -1)
        for span in self.periods:
            segment[(time >= span.since) & (time <= span.until)] = span.level
        last = self.periods[-1]
        if self.segment[-1] >= 0:
            segment[time > last.until] = last.level
        risen = _risen(time, last.since, last.until) if self.grows else None
        return replace(self, segment=segment, risen=risen)

    @property
    def levels(self) -> int:
        """Number of levels."""
        return 1 + max((p.level for p in self.periods), default=-1)

    def names(self) -> tuple[str, ...]:
        """Names of the values, one per level."""
        return tuple(f"{self.unknown}#{i}" for i in range(self.levels))

    def degrees(self, values: Mapping[str, float]) -> Array:
        """The unknown at each point, shape (n,)."""
        levels = [values[name] * self.share(i) for i, name in enumerate(self.names())]
        return np.asarray(np.sum(levels, axis=0))

    def share(self, level: int) -> Array:
        """Share of a level at each point, shape (n,)."""
        share: Array = (self.segment == level).astype(float)
        if self.ahead is not None:
            share = share * (1.0 - self.ahead) + (self.segment == level - 1) * self.ahead
        return share if self.risen is None else share * self.risen


def lasting(unknown: str, begin: float, time: Array, *, grows: bool = False) -> Course:
    """An unknown that is present, or grows, from a time on, s; `time` has shape (n,)."""
    until = float(time[-1])
    return Course(
        unknown,
        np.where(time >= begin, 0, -1),
        (Span(begin, until, 0),),
        risen=_risen(time, begin, until) if grows else None,
    )


def _risen(time: Array, since: float, until: float) -> Array:
    """Share of the level at `until` that is reached at each time, shape (n,)."""
    return np.asarray(np.maximum(time - since, 0.0) / max(until - since, 1e-300))


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """Joined candidates and values, SI.

    `values` has base parameters, sensor errors (`ERROR`), unknowns and degrees of periods; `fixed`
    has references of joined candidates. `priors` has mean, scale and degrees of freedom of the
    prior of unknowns, if any.
    """

    joined: tuple[Candidate, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    courses: tuple[Course, ...] = ()
    priors: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of candidates that are built into module types."""
        return tuple(c.id for c in self.joined if c.sort != HIDDEN)

    @property
    def locations(self) -> tuple[str, ...]:
        """Ids of places and parameters that have an error with a free course in time."""
        return tuple(c.id for c in self.joined if c.sort == HIDDEN)

    def candidate_of(self, course: Course) -> Candidate:
        """The candidate with a course."""
        return next(c for c in self.joined if course.unknown in {u.id for u in c.unknowns})

    @property
    def in_periods(self) -> frozenset[str]:
        """Ids of unknowns that are present in some periods only."""
        return frozenset(c.unknown for c in self.courses)

    def free_unknowns(self) -> tuple[str, ...]:
        """Free unknowns of the joined candidates, with one value per level of a course."""
        free = (u.id for c in self.joined for u in c.unknowns if not u.fixed)
        names = (name for course in self.courses for name in course.names())
        return (*(id_ for id_ in free if id_ not in self.in_periods), *names)

    def limits(self) -> Mapping[str, tuple[float, float]]:
        """Allowed range of each unknown."""
        ranges = {u.id: (u.lowest, u.highest) for c in self.joined for u in c.unknowns}
        return {name: ranges[name.partition("#")[0]] for name in self.free_unknowns()}

    def at_points(self, time: Array) -> Configuration:
        """The configuration at other points, shape (n,), s.

        The value of a growing course is the degree at the last point.
        """
        values, courses = dict(self.values), []
        for course in self.courses:
            if course.grows:
                ((own,), (name,)) = course.periods, course.names()
                course = course.since(own.since, time)
                values[name] *= (course.periods[0].until - own.since) / (own.until - own.since)
            else:
                course = course.at_times(time)
            courses.append(course)
        return replace(self, values=values, courses=tuple(courses))

    def joining(
        self,
        candidate: Candidate,
        values: Mapping[str, float],
        fixed: Mapping[str, float],
        course: Course | None = None,
    ) -> Configuration:
        """Add a candidate."""
        return replace(
            self,
            joined=(*self.joined, candidate),
            values={**self.values, **values},
            fixed={**self.fixed, **fixed},
            courses=self.courses if course is None else (*self.courses, course),
        )

    def leaving(self, *candidates: str) -> Configuration:
        """Remove candidates."""
        gone = {u.id for c in self.joined if c.id in candidates for u in c.unknowns}
        return replace(
            self,
            joined=tuple(c for c in self.joined if c.id not in candidates),
            values={n: v for n, v in self.values.items() if n.partition("#")[0] not in gone},
            fixed={n: v for n, v in self.fixed.items() if n not in gone},
            courses=tuple(c for c in self.courses if c.unknown not in gone),
        )
