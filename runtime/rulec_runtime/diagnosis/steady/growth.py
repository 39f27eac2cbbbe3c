"""How large a fault is now, how fast it grows, and when it will reach which degree."""

from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.degree_course import Course, Moments
from rulec_runtime.recordings.plant_calendar import DAY, HOUR


@dataclass(frozen=True, kw_only=True)
class NextDegree:
    """A degree that a fault will reach, and when, s; `open_end` if it may be later still."""

    degree: float
    earliest: float
    latest: float
    open_end: bool


@dataclass(frozen=True, kw_only=True)
class Growth:
    """Size of a fault at the end, and its growth; each with 95 % bounds.

    Attributes
    ----------
    degree, lower, upper : at `time`, s.
    rate : growth per second with its bounds; None if too few stretches show it.
    grows : whether growth explains the readings better than steps do.
    next_degree : the next round degree.
    path : times, s, degrees and their standard uncertainties, for a plot.
    """

    time: float
    degree: float
    lower: float
    upper: float
    rate: tuple[float, float, float] | None = None
    grows: bool = False
    next_degree: NextDegree | None = None
    path: tuple[tuple[float, float, float], ...] = ()

    @property
    def per(self) -> tuple[float, str]:
        """Unit of growth rates, s, and its name: a day if followed for more than two, else an
        hour."""
        lasted = self.time - self.path[0][0] if self.path else 0.0
        return (DAY, "d") if lasted > 2.0 * DAY else (HOUR, "h")


def growth_of(fault: FaultSpec, course: Course, time: float) -> Growth:
    """Growth by the end of a course."""
    by_steps = None if course.grows else _rate_of_steps(course, time)
    rate = by_steps or _between(course.rate)
    growing = (course.grows or by_steps is not None) and rate[1] > 0.0
    now = np.clip(_between(course.now), fault.lowest, fault.highest).tolist()
    path = zip(course.time.tolist(), course.degree.tolist(), course.u.tolist(), strict=True)
    return Growth(
        time=time,
        degree=now[0],
        lower=now[1],
        upper=now[2],
        rate=rate,
        grows=course.grows,
        next_degree=_next_degree(fault, course, rate, time) if growing else None,
        path=tuple(path),
    )


def _between(value: Moments) -> tuple[float, float, float]:
    middle, u = value
    return middle, middle - common.COVERAGE * u, middle + common.COVERAGE * u


def _rate_of_steps(course: Course, time: float) -> tuple[float, float, float] | None:
    """Growth of a degree that goes up in steps, as of steps at random times; None if a step goes
    down, or if there are too few."""
    sizes = [size for at, size in course.steps if at > course.time[0]]
    if len(sizes) < limits.STEPS_THAT_GROW or min(sizes) <= 0.0:
        return None
    rate = sum(sizes) / (time - float(course.time[0]))
    wide = float(np.exp(common.COVERAGE / len(sizes) ** 0.5))
    return rate, rate / wide, rate * wide


def _next_degree(
    fault: FaultSpec, course: Course, rate: tuple[float, float, float], time: float
) -> NextDegree | None:
    """When the next round degree is reached, if growth continues."""
    level = next_level(_between(course.now)[2])
    if level >= fault.credible:
        return None
    if not course.grows:
        ahead, pause = (level - course.now[0]) / rate[1], time - course.steps[-1][0]
        return NextDegree(degree=level, earliest=time, latest=time + ahead + pause, open_end=False)
    later, middle, u = course.ahead
    soon, sure = (middle + sign * common.COVERAGE * u >= level for sign in (1.0, -1.0))
    # The last of the times ahead if it is not reached by then.
    earliest, latest = (float(later[np.argmax(x) if x.any() else -1]) for x in (soon, sure))
    return NextDegree(degree=level, earliest=earliest, latest=latest, open_end=not sure.any())


def next_level(degree: float) -> float:
    """The next round number.

    >>> [round(next_level(x), 6) for x in (0.031, 0.12, 0.5, 0.93)]
    [0.04, 0.15, 0.6, 1.0]
    """
    decade = 10.0 ** np.floor(np.log10(degree))
    round_ones = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
    return float(next(decade * step for step in round_ones if decade * step > degree))
