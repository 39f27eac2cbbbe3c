"""A driver that nobody recorded: its course from what is left, and what it looks like."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from runtime.mismatch.candidate import Candidate, Spot, Unknown
from runtime.mismatch.fit import Fitted
from runtime.mismatch.locate import Suspect, spot_column, suspects
from runtime.mismatch.periods import degree_course
from runtime.mismatch.screen import Trial
from runtime.mismatch.setting import HIDDEN, Course, Span
from runtime.plan import Array

WINDOWS = 40
"""Values of a course that is free in time."""

LOOKED_AT = 2
"""Most suspect places at which such a course is tried."""


def hidden_trials(fitted: Fitted) -> list[Trial]:
    """An error with a course that is free in time, at the most suspect places."""
    data = fitted.rows.system.data
    if data.of_rows:
        return []
    places = [s for s in suspects(fitted) if s.spot.id not in fitted.setting.spots]
    return [_trial(fitted, s) for s in places[:LOOKED_AT]]


def _trial(fitted: Fitted, suspect: Suspect) -> Trial:
    data = fitted.rows.system.data
    spot = suspect.spot
    known = np.flatnonzero((suspect.weight > 0) & fitted.used)
    window = np.full(len(data), -1)
    edges = np.linspace(0, len(known), min(WINDOWS, len(known)) + 1).astype(int)
    periods, values = [], {}
    for i, (low, high) in enumerate(pairwise(edges)):
        inside = known[low:high]
        last = known[high] if high < len(known) else len(data)
        window[inside[0] : last] = i
        periods.append(Span(float(data.time[inside[0]]), float(data.time[inside[-1]]), i))
        middle = float(np.median(suspect.course[inside]))
        values[f"{spot.unknown}#{i}"] = middle
    course = Course(spot.unknown, window, tuple(periods))
    return Trial(_candidate(spot), values, {}, 0.0, course)


def _candidate(spot: Spot) -> Candidate:
    unknown = Unknown(
        spot.unknown, "e", "error", spot.unit, spot.factor, 0.0, 0.0, -np.inf, np.inf,
        (), (), None, False,
    )  # fmt: skip
    return Candidate(
        spot.id,
        HIDDEN,
        HIDDEN,
        "Something that is not recorded",
        spot.module,
        spot.place,
        spot.observers,
        (unknown,),
        {},
        "",
        f"{spot.module}.{spot.place} follows something that is not recorded",
        "",
        "",
    )


@dataclass(frozen=True)
class Reconstruction:
    """A course at a place, shape (points,), SI, and the times of it."""

    spot: Spot
    time: Array
    course: Array


def reconstruct(fitted: Fitted, name: str) -> Reconstruction:
    """The course of a hidden driver, at every point that speaks of it.

    What is left of each point is added to the value of its window, and smoothed.
    """
    system = fitted.rows.system
    spot = next(s for s in system.workshop.spots if s.id == name)
    course = next(c for c in fitted.setting.courses if c.unknown == spot.unknown)
    column = spot_column(fitted, spot)
    level = course.degrees(fitted.setting.values)
    if column is None:
        return Reconstruction(spot, system.data.time, level)
    rest, weight = degree_course(fitted, column)
    known = np.flatnonzero(np.isfinite(rest) & (course.segment >= 0))
    values = level[known] + _clipped(rest[known])
    smooth = _smoothed(values, weight[known], len(known) // (6 * WINDOWS))
    return Reconstruction(spot, system.data.time[known], smooth)


def _clipped(values: Array) -> Array:
    """One odd point is no course."""
    middle = float(np.median(values))
    spread = 1.4826 * float(np.median(np.abs(values - middle))) or float(np.std(values))
    clipped: Array = np.clip(values, middle - 3.0 * spread, middle + 3.0 * spread)
    return clipped


def _smoothed(values: Array, weight: Array, width: int) -> Array:
    kernel = np.hanning(2 * max(width, 1) + 3)[1:-1]
    top = np.convolve(values * weight, kernel, mode="same")
    smooth: Array = top / np.convolve(weight, kernel, mode="same")
    return smooth


def described(time: Array, course: Array) -> str:
    """What a course looks like, in words that a plant engineer can match to a cause."""
    span = float(np.ptp(course))
    if span == 0:
        return "constant"
    length = float(time[-1] - time[0])
    level = (course - course[0]) / span
    tail = float(np.median(level[-max(len(level) // 5, 1) :]))
    parts = ["slow"]
    ahead = level * np.sign(tail)
    first = int(np.argmax(ahead > 0.63 * abs(tail)))
    if abs(tail) > 0.3 and float(ahead[: first + 1].min()) > -0.33:
        when = float(time[first] - time[0])
        way = "rises" if tail > 0 else "falls"
        parts.append(f"{way} from the start, two thirds of the way within {_span(when)}")
    turns = _turns(level)
    if turns:
        parts.append(f"turns {turns} time{'s' * (turns > 1)} over {_span(length)}")
    rests = np.diff(time)
    long = np.flatnonzero(rests > 20.0 * np.median(rests))
    back = [i for i in long if abs(level[i + 1]) < 0.5 * abs(level[i])]
    if back:
        parts.append("returns during stops")
    return ", ".join(parts)


def _turns(level: Array) -> int:
    """Changes of direction larger than a third of the span."""
    turns, extreme, direction = 0, float(level[0]), 0
    for value in level:
        if direction >= 0 and value < extreme - 0.33:
            turns += direction > 0
            direction, extreme = -1, float(value)
        elif direction <= 0 and value > extreme + 0.33:
            turns += direction < 0
            direction, extreme = 1, float(value)
        elif direction * (value - extreme) > 0 or direction == 0:
            extreme = max(extreme, float(value)) if direction > 0 else extreme
            extreme = min(extreme, float(value)) if direction < 0 else extreme
    return turns


def _span(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
