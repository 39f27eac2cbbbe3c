"""How large a fault is now, how fast it grows, and when it will be how large."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.steady.course import Course


@dataclass(frozen=True, kw_only=True)
class Reaches:
    """A degree that a fault will reach, and between which times, s; `latest` is None where it may
    as well stay below."""

    degree: float
    earliest: float
    latest: float | None


@dataclass(frozen=True, kw_only=True)
class Growth:
    """How large a fault is at the end, and how fast it grows; each with its 95 % bounds.

    Attributes
    ----------
    degree, lower, upper : at `time`, s.
    rate, slowest, fastest : growth per second; None where too few stretches tell it.
    grows : whether growth explains the readings better than steps do.
    reaches : where it is going.
    path : times, s, degrees and their standard uncertainties, of which a picture is made.
    """

    time: float
    degree: float
    lower: float
    upper: float
    rate: float | None = None
    slowest: float | None = None
    fastest: float | None = None
    grows: bool = False
    reaches: Reaches | None = None
    path: tuple[tuple[float, float, float], ...] = ()


def growth_of(fault: FaultSpec, course: Course, time: float) -> Growth:
    """What a course says of its end."""
    (degree, u), (rate, u_rate) = course.now, course.rate
    slowest, fastest = rate - limits.COVERAGE * u_rate, rate + limits.COVERAGE * u_rate
    grows = course.grown > limits.GROWS
    return Growth(
        time=time,
        degree=min(max(degree, fault.lowest), fault.highest),
        lower=max(degree - limits.COVERAGE * u, fault.lowest),
        upper=min(degree + limits.COVERAGE * u, fault.highest),
        rate=rate,
        slowest=slowest,
        fastest=fastest,
        grows=grows,
        reaches=_reaches(fault, course, time) if grows and slowest > 0.0 else None,
        path=tuple(
            zip(course.time.tolist(), course.degree.tolist(), course.u.tolist(), strict=True)
        ),
    )


def _reaches(fault: FaultSpec, course: Course, time: float) -> Reaches | None:
    """When the next round degree is reached, at this rate and with bends like those so far."""
    level = _next_level(course.now[0] + limits.COVERAGE * course.now[1])
    if level >= fault.credible:
        return None
    ahead = (level - course.now[0]) / course.rate[0]
    later = ahead * np.geomspace(limits.SOONEST, limits.LATEST, limits.TIMES_AHEAD)
    middle = course.now[0] + course.rate[0] * later
    variance = (
        course.now[1] ** 2
        + 2.0 * course.shared * later
        + (course.rate[1] * later) ** 2
        + course.bend * later**3 / 3.0
    )
    half = limits.COVERAGE * np.sqrt(np.maximum(variance, 0.0))
    earliest, latest = _first(later, middle + half >= level), _first(later, middle - half >= level)
    return Reaches(
        degree=level,
        earliest=time + (0.0 if earliest is None else earliest),
        latest=None if latest is None else time + latest,
    )


def _first(later: Array, there: np.ndarray) -> float | None:
    return float(later[int(np.argmax(there))]) if there.any() else None


def _next_level(degree: float) -> float:
    """The next of 1, 2, 5, 10, ... of a decade.

    >>> [round(_next_level(x), 6) for x in (0.031, 0.12, 0.5, 0.93)]
    [0.05, 0.2, 1.0, 1.0]
    """
    decade = 10.0 ** np.floor(np.log10(degree))
    return float(decade * next(step for step in (1.0, 2.0, 5.0, 10.0) if decade * step > degree))
