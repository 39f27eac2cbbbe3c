"""A model in numbers: what is joined, and the values of everything in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate

ERROR = "error:"
"""Mark before a signal's id: its systematic error, in standard uncertainties of its class."""

OF_RECORDING = "|"
"""Mark behind the name of an error, before the number of the recording that has it as its own."""


def own_error(signal: str, number: int) -> str:
    """Name of the part of a sensor's error that one of several recordings has as its own."""
    return f"{ERROR}{signal}{OF_RECORDING}{number}"


def reading_and_recording(error: str) -> tuple[str, int | None]:
    """The signal of an error, and the number of the recording that has it as its own.

    >>> reading_and_recording("error:A.dp"), reading_and_recording("error:A.dp|1")
    (('A.dp', None), ('A.dp', 1))
    """
    signal, mark, number = error.removeprefix(ERROR).partition(OF_RECORDING)
    return signal, int(number) if mark else None


HIDDEN = "hidden"
"""Sort of what stands for a driver that is not recorded: an error at a place, free in time."""

CHANGE = "~"
"""Mark behind the id of a parameter: by how much it differs from its value, where that is free in
time."""


@dataclass(frozen=True)
class Span:
    """A period, s, and the number of the level it has."""

    since: float
    until: float
    level: int


@dataclass(frozen=True)
class Course:
    """An unknown that has one of a few levels in some periods, and none outside.

    `segment` has shape (n,): the number of the level at each point, -1 outside. A course that is
    smooth passes from each level to the next: `ahead`, shape (n,), is how far it is. One that grows
    is nothing at first and reaches its level where its period ends: `risen`, shape (n,), is the
    share of the level that is there.
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
        """The same, from another time on, s, to the end; `time`, s, has shape (n,)."""
        level, until = self.periods[0].level, float(time[-1])
        return replace(
            self,
            segment=np.where(time >= begin, level, -1),
            periods=(Span(begin, until, level),),
            risen=_risen(time, begin, until) if self.grows else None,
        )

    def at_times(self, time: Array) -> Course:
        """The same periods at other points; what lasts to the end does so there too."""
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
        """How many levels there are."""
        return 1 + max((p.level for p in self.periods), default=-1)

    def names(self) -> tuple[str, ...]:
        """Names of the values, one per level."""
        return tuple(f"{self.unknown}#{i}" for i in range(self.levels))

    def degrees(self, values: Mapping[str, float]) -> Array:
        """The unknown at each point, shape (n,)."""
        levels = [values[name] * self.share(i) for i, name in enumerate(self.names())]
        course: Array = np.sum(levels, axis=0)
        return course

    def share(self, level: int) -> Array:
        """How much of a level is there at each point, shape (n,)."""
        share: Array = (self.segment == level).astype(float)
        if self.ahead is not None:
            share = share * (1.0 - self.ahead) + (self.segment == level - 1) * self.ahead
        return share if self.risen is None else share * self.risen


def lasting(unknown: str, begin: float, time: Array, *, grows: bool = False) -> Course:
    """An unknown that is there from a time on, s, or grows from then on; `time` has shape (n,)."""
    until = float(time[-1])
    return Course(
        unknown,
        np.where(time >= begin, 0, -1),
        (Span(begin, until, 0),),
        risen=_risen(time, begin, until) if grows else None,
    )


def _risen(time: Array, since: float, until: float) -> Array:
    """Share of what is reached at `until` that is there at each time, shape (n,)."""
    risen: Array = np.maximum(time - since, 0.0) / max(until - since, 1e-300)
    return risen


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """What is joined and the values of what is free; numbers in SI.

    `values` holds base parameters, sensor errors (`ERROR`), unknowns and degrees of periods;
    `fixed` references of joined candidates. `known` are mean, scale and degrees of freedom of
    unknowns, as far as they are known before.
    """

    joined: tuple[Candidate, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    courses: tuple[Course, ...] = ()
    known: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of what is built into module types."""
        return tuple(c.id for c in self.joined if c.sort != HIDDEN)

    @property
    def spots(self) -> tuple[str, ...]:
        """Ids of places, and of parameters, with an error whose course is free in time."""
        return tuple(c.id for c in self.joined if c.sort == HIDDEN)

    def candidate_of(self, course: Course) -> Candidate:
        """What has a course."""
        return next(c for c in self.joined if course.unknown in {u.id for u in c.unknowns})

    @property
    def in_periods(self) -> frozenset[str]:
        """Ids of unknowns that are there in some periods only."""
        return frozenset(c.unknown for c in self.courses)

    def free_unknowns(self) -> tuple[str, ...]:
        """Unknowns of what is joined, those in periods as one each."""
        plain = [
            u.id
            for c in self.joined
            for u in c.unknowns
            if not u.fixed and u.id not in self.in_periods
        ]
        return (*plain, *(name for course in self.courses for name in course.names()))

    def limits(self) -> Mapping[str, tuple[float, float]]:
        """Legal range of each unknown."""
        ranges = {u.id: (u.lowest, u.highest) for c in self.joined for u in c.unknowns}
        return {name: ranges[name.partition("#")[0]] for name in self.free_unknowns()}

    def joining(
        self,
        candidate: Candidate,
        values: Mapping[str, float],
        fixed: Mapping[str, float],
        course: Course | None = None,
    ) -> Configuration:
        """With one more candidate."""
        return replace(
            self,
            joined=(*self.joined, candidate),
            values={**self.values, **values},
            fixed={**self.fixed, **fixed},
            courses=self.courses if course is None else (*self.courses, course),
        )

    def leaving(self, candidate: str) -> Configuration:
        """Without one of the candidates."""
        gone = {u.id for c in self.joined if c.id == candidate for u in c.unknowns}
        return replace(
            self,
            joined=tuple(c for c in self.joined if c.id != candidate),
            values={n: v for n, v in self.values.items() if n.partition("#")[0] not in gone},
            fixed={n: v for n, v in self.fixed.items() if n not in gone},
            courses=tuple(c for c in self.courses if c.unknown not in gone),
        )
