"""A driver that nobody recorded: its course, from the residual, and a description of that."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.plant_calendar import duration
from rulec_runtime.recordings.robust_statistics import spread_about
from scipy.signal import find_peaks

from rulec.effects.candidate import Candidate, DisturbanceLocation, Unknown
from rulec.mismatch.evidence.configuration import HIDDEN, Course, Span
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.screen import (
    InitialCandidate,
    Suspect,
    column_at,
    parameter_at,
)
from rulec.mismatch.search import limits
from rulec.mismatch.search.intermittent_fault import degree_course


def free_course(fitted: Fitted, suspect: Suspect) -> InitialCandidate:
    """An error at a place, with a free course in time."""
    data, location = fitted.rows.system.data, suspect.location
    used = np.flatnonzero((suspect.weight > 0) & fitted.used)
    levels = _levels_of(suspect.course[used], suspect.weight[used])
    # Held-out points are interpolated; beyond the known points the course is constant.
    at = np.interp(np.arange(len(data)), used, np.linspace(0.0, len(levels) - 1.0, len(used)))
    segment = np.minimum(at.astype(int), len(levels) - 1)
    knots = data.time[used[np.linspace(0, len(used) - 1, len(levels)).astype(int)]]
    ends = [*((knots[1:] + knots[:-1]) / 2.0), knots[-1]]
    edges = itertools.pairwise([float(knots[0]), *map(float, ends)])
    periods = tuple(Span(since, until, i) for i, (since, until) in enumerate(edges))
    values = {f"{location.unknown}#{i}": v for i, v in enumerate(levels.tolist())}
    course = Course(location.unknown, segment, periods, at - segment)
    return _trial(location, values, course)


def switched_course(
    fitted: Fitted, location: DisturbanceLocation, on: NDArray[np.bool_]
) -> InitialCandidate:
    """An error at a place that is present at some points, flags of shape (n,), only."""
    time = fitted.rows.system.data.time
    first = np.flatnonzero(on & ~np.append(False, on[:-1]))
    last = np.flatnonzero(on & ~np.append(on[1:], False))
    periods = tuple(
        Span(float(time[i]), float(time[j]), 0) for i, j in zip(first, last, strict=True)
    )
    course = Course(location.unknown, np.where(on, 0, -1), periods)
    return _trial(location, {f"{location.unknown}#0": 0.0}, course)


def _levels_of(course: Array, weight: Array) -> Array:
    """Values at the knots of a piecewise linear course, with as many knots as pay for themselves.

    Source: Schwarz 1978, with free scale.
    """
    n, root, near = len(course), np.sqrt(weight), _clipped(course)
    best: tuple[float, Array] | None = None
    for count in limits.LATENT_KNOTS:
        if count > max(n // limits.KNOT_POINTS, 2):
            break
        at = np.linspace(0.0, count - 1.0, n)
        table = np.maximum(1.0 - np.abs(at[:, None] - np.arange(count)), 0.0)
        levels = np.linalg.lstsq(table * root[:, None], near * root, rcond=None)[0]
        left = float(np.sum(weight * (near - table @ levels) ** 2))
        cost = 0.5 * (n * float(np.log(left + 1e-300)) + count * float(np.log(n)))
        if best is None or cost < best[0]:
            best = (cost, levels)
    assert best is not None
    return best[1]


def _clipped(values: Array) -> Array:
    """Values without outliers: a single point must not attract the course."""
    middle = float(np.median(values))
    spread = spread_about(values, middle) or float(np.std(values))
    far = limits.KNOT_ODD * spread
    return np.asarray(np.clip(values, middle - far, middle + far))


def _trial(
    location: DisturbanceLocation, values: dict[str, float], course: Course
) -> InitialCandidate:
    unknown = Unknown(
        id=location.unknown,
        name="e",
        title="error",
        unit=location.unit,
        factor=location.factor,
        null=0.0,
    )
    candidate = Candidate(
        id=location.id,
        sort=HIDDEN,
        name=HIDDEN,
        title="Something that is not recorded",
        module=location.module,
        place=location.place,
        observers=location.observers,
        unknowns=(unknown,),
        drivers={},
        equation="",
        text=f"{location.module}.{location.place} follows something that is not recorded",
        action="",
        source="",
    )
    return InitialCandidate(candidate=candidate, values=values, fixed={}, gain=0.0, course=course)


@dataclass(frozen=True)
class Reconstruction:
    """A course at a place, SI, and its times, s; both of shape (points,)."""

    location: DisturbanceLocation
    time: Array
    course: Array


def reconstruct(fitted: Fitted, name: str) -> Reconstruction:
    """The course of a hidden driver, at every point that depends on it.

    The residual of each point is added to the level of its window, and the sum is smoothed.
    """
    system = fitted.rows.system
    course = next(c for c in fitted.setting.courses if fitted.setting.candidate_of(c).id == name)
    candidate = fitted.setting.candidate_of(course)
    place = candidate.module, candidate.place
    here = [s for s in system.builder.locations if (s.module, s.place) == place]
    location = next((s for s in here if s.id == candidate.id), None)
    if location is None:
        (unknown,) = candidate.unknowns
        location = parameter_at(here[0], candidate.id, unknown.id, unknown.unit, unknown.factor)
    column = column_at(fitted, location)
    level = course.degrees(fitted.setting.values)
    if column is None:
        return Reconstruction(location, system.data.time, level)
    rest, weight = degree_course(fitted, column)
    finite = np.flatnonzero(np.isfinite(rest) & (course.segment >= 0))
    values, weight = level[finite] + _clipped(rest[finite]), weight[finite]
    kernel = np.hanning(2 * max(len(finite) // (6 * limits.LATENT_KNOTS[-1]), 1) + 3)[1:-1]
    total = np.convolve(values * weight, kernel, mode="same")
    smooth: Array = total / np.convolve(weight, kernel, mode="same")
    return Reconstruction(location, system.data.time[finite], smooth)


def likeness(first: Reconstruction, second: Reconstruction) -> float:
    """Correlation of two courses, over the time of the first."""
    along = np.interp(first.time, second.time, second.course)
    if np.ptp(along) == 0 or np.ptp(first.course) == 0:
        return 0.0
    return float(np.corrcoef(first.course, along)[0, 1])


def described(time: Array, course: Array) -> str:
    """Describe a course in words that a plant engineer can match to a cause."""
    span = float(np.ptp(course))
    if span == 0:
        return "constant"
    level = (course - course[0]) / span
    tail = float(np.median(level[-max(len(level) // 5, 1) :]))
    parts = ["slow"]
    ahead = level * np.sign(tail)
    first = int(np.argmax(ahead > 0.63 * abs(tail)))
    if abs(tail) > 0.3 and float(ahead[: first + 1].min()) > -0.33:
        way, when = "rises" if tail > 0 else "falls", duration(float(time[first] - time[0]))
        parts.append(f"{way} from the start, two thirds of the way within {when}")
    turns = sum(len(find_peaks(sign * level, prominence=0.33)[0]) for sign in (1.0, -1.0))
    if turns:
        length = duration(float(time[-1] - time[0]))
        parts.append(f"turns {turns} time{'s' * (turns > 1)} over {length}")
    rests = np.diff(time)
    long = np.flatnonzero(rests > 20.0 * np.median(rests))
    if any(abs(level[i + 1]) < 0.5 * abs(level[i]) for i in long):
        parts.append("returns during stops")
    return ", ".join(parts)
