"""Faults that come and go: the course of a degree, cut into periods.

The degree that explains the residuals best is estimated at every point. Its course in time is cut
where a step pays for itself; levels that differ from those at rest are periods of the fault.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust_statistics import white_noise

from rulec.effects.candidate import Candidate, Unknown
from rulec.mismatch.evidence.steady.configuration import Course, Span
from rulec.mismatch.evidence.steady.fit import Fitted, student_weights
from rulec.mismatch.evidence.steady.screen import (
    InitialCandidate,
    ScoreTest,
    columns_of,
    score_tests_at,
)
from rulec.mismatch.search import limits
from rulec.mismatch.search.segments import Segments, apart, cut, few_levels, runs_of


def intermittent(fitted: Fitted, candidates: Sequence[Candidate]) -> list[InitialCandidate]:
    """The faults among the candidates that gain most if they come and go, by falling gain."""
    if not fitted.rows.system.data.timed:
        return []
    trials = [in_periods(fitted, c) for c in candidates if c.sort == "fault"]
    found = [t for t in trials if t is not None]
    return sorted(found, key=lambda t: -t.gain)[: limits.COMING]


def in_periods(fitted: Fitted, candidate: Candidate) -> InitialCandidate | None:
    """A fault that comes and goes; None where its degree shows no such course."""
    unknown = next((u for u in candidate.unknowns if u.null is not None), None)
    if unknown is None or unknown.null is None:
        return None
    columns = columns_of(fitted, candidate, {unknown.id: unknown.null}, {})
    if columns is None:
        return None
    tests, column = score_tests_at(fitted), columns[:, 0]
    degree, weight = degree_course(fitted, column)
    # Held-out points do not count, but a period includes those within it.
    known = np.flatnonzero(np.isfinite(degree) & fitted.used)
    if len(known) < 4 * limits.SHORTEST:
        return None
    edges = np.linspace(0, len(known), min(limits.LONGEST_COURSE, len(known)) + 1).astype(int)
    weight = weight[known]
    sums = np.add.reduceat(weight, edges[:-1])
    value = np.add.reduceat(weight * degree[known], edges[:-1]) / sums
    # Robust against steps.
    noise = white_noise(np.diff(value), 1) or float(np.std(value)) or 1.0
    segments = cut(value / noise, limits.STEP_PENALTY * float(np.log(len(value))))
    states = [apart(segments, odd) for odd in limits.ODD]
    some = [on for on in states if on.any() and not on.all()]
    states = [*some, *(_longest(segments, on) for on in some), *(_hull(on) for on in some)]
    means = _Means(known, edges, value, sums, noise)
    ways = list({tuple(np.flatnonzero(on)): (segments, on) for on in states}.values())
    if len(segments.first) > 1:
        ways.append(_begun(fitted, tests, unknown, column, means))
    trials = [
        _trial(fitted, tests, candidate, unknown, column, means, *way, levels)
        for way in ways
        for levels in (1, limits.MOST_LEVELS)
        if way[1].any() and not way[1].all()
    ]
    each = 0.5 * float(np.log(max(fitted.rows.groups, 2)))
    found = [t for t in trials if t is not None]
    return max(found, key=lambda t: _likely(t, each), default=None)


def _longest(segments: Segments, on: np.ndarray) -> np.ndarray:
    """The longest period only: the others may be noise."""
    first, last = max(runs_of(segments, on), key=lambda run: run[1] - run[0])
    return np.asarray((segments.first >= first) & (segments.first < last) & on)


def _hull(on: np.ndarray) -> np.ndarray:
    """One period from the first to the last: the gaps may be noise as well."""
    there = np.flatnonzero(on)
    inside: np.ndarray = np.zeros(len(on), dtype=bool)
    inside[there[0] : there[-1] + 1] = True
    return inside


def _begun(
    fitted: Fitted, tests: Sequence[ScoreTest], unknown: Unknown, column: Array, means: _Means
) -> tuple[Segments, np.ndarray]:
    """One permanent change, at the time that explains most.

    Values are refitted beside it: those of a plain fit lie between the values before and after the
    change, and so hide a part of it.
    """
    count = len(means.value)
    begins = np.unique(
        np.linspace(limits.SHORTEST, count - limits.SHORTEST, limits.BEGINS).astype(int)
    )
    since = means.known[means.edges[begins]]
    terms = column[:, None] * (fitted.rows.point[:, None] >= since)
    null = unknown.null or 0.0
    low, high = (np.full(len(begins), end - null) for end in (unknown.lowest, unknown.highest))
    each = np.arange(len(begins))[:, None]
    gains = np.max([test.best_of(terms, each, low, high)[1] for test in tests], axis=0)
    first = np.array([0, begins[int(np.argmax(gains))]])
    length = np.diff(np.append(first, count))
    level = np.add.reduceat(means.value, first) / length / means.noise
    return Segments(first, level, length), np.array([False, True])


def _likely(trial: InitialCandidate, each: float) -> float:
    """Gain of a trial less the price of its periods and degrees.

    A fault that begins is likelier than one that was there and ended.
    """
    course = trial.course
    assert course is not None
    first = int(np.flatnonzero(course.segment >= 0)[0])
    begins = first > 0 and course.periods[0].since > 0.0
    price = each * (limits.PERIOD_PRICE * len(course.periods) + course.levels)
    return trial.gain * (1.0 if begins else limits.PASSING) - price


@dataclass(frozen=True)
class _Means:
    """Means of a course over points ``known[edges[i] : edges[i + 1]]``, and their weights."""

    known: NDArray[np.intp]
    edges: NDArray[np.intp]
    value: Array
    weight: Array
    noise: float


def _trial(
    fitted: Fitted,
    tests: Sequence[ScoreTest],
    candidate: Candidate,
    unknown: Unknown,
    column: Array,
    means: _Means,
    segments: Segments,
    on: np.ndarray,
    most: int,
) -> InitialCandidate | None:
    """The fault with at most `most` degrees; None where no period is long enough."""
    null = unknown.null or 0.0
    rest = float(np.average(segments.level[~on], weights=segments.length[~on])) * means.noise
    runs, levels = [], []
    for first, last in runs_of(segments, on):
        level = float(np.average(means.value[first:last], weights=means.weight[first:last])) - rest
        level = float(np.clip(null + level, unknown.lowest, unknown.highest))
        if level != null and last - first >= limits.SHORTEST:
            runs.append((first, last))
            levels.append(level)
    if not runs:
        return None
    number, centres = few_levels(np.array(levels), np.array([b - a for a, b in runs]), most)
    segment = np.full(len(fitted.rows.system.data), -1)
    time = fitted.rows.system.data.time
    periods = []
    for first, last, i in _joined(runs, number):
        inside = means.known[means.edges[first] : means.edges[last]]
        segment[inside[0] : inside[-1] + 1] = i
        periods.append(Span(float(time[inside[0]]), float(time[inside[-1]]), int(i)))
    course = Course(unknown.id, segment, tuple(periods))
    values = dict(zip(course.names(), centres.tolist(), strict=True))
    term = column * (course.degrees(values) - null)[fitted.rows.point]
    wide = np.array([np.inf])
    gain = max(test.best(term[:, None], -wide, wide)[1] for test in tests)
    return InitialCandidate(candidate=candidate, values=values, fixed={}, gain=gain, course=course)


def _joined(
    runs: Sequence[tuple[int, int]], number: NDArray[np.intp]
) -> Iterator[tuple[int, int, int]]:
    """Runs with the number of their level; short gaps between two of one level are closed."""
    first, last, level = *runs[0], int(number[0])
    for (begin, end), i in zip(runs[1:], number[1:].tolist(), strict=True):
        if begin - last < limits.SHORTEST and i == level:
            last = end
            continue
        yield first, last, level
        first, last, level = begin, end, i
    yield first, last, level


def degree_course(fitted: Fitted, column: Array) -> tuple[Array, Array]:
    """The degree that explains each point best, shape (n,), and its weight (1/variance).

    NaN at points where no residual depends on it.
    """
    rows = fitted.rows
    n = len(rows.system.data)
    # Outliers of the model count little here as well.
    sound = column * student_weights(rows, fitted.residual, fitted.scale)
    weight = np.bincount(rows.point, column * sound, minlength=n).astype(float)
    moment = np.bincount(rows.point, sound * fitted.residual, minlength=n).astype(float)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Whether residuals depend on the degree has nothing to do with their size. Where a module
        # moves, only rounding errors are left of its slopes.
        slope = np.bincount(rows.point, column**2, minlength=n).astype(float)
        least = limits.FAINT * float(np.sum(slope**2) / max(np.sum(slope), 1e-300))
        degree: Array = np.where(slope > least, -moment / weight, np.nan)
    return degree, weight
