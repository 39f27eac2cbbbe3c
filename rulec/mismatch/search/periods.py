"""Faults that come and go: the course of a degree, cut into periods.

The degree that would explain the residuals best is found at every point. Its course in time is cut
where a step pays for itself; levels that stand apart from those at rest are periods of the fault.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust import white_noise

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


def intermittent(
    fitted: Fitted, candidates: Sequence[Candidate], most: float = np.inf
) -> list[InitialCandidate]:
    """Faults as ones that come and go, in so many periods at most, the more telling first."""
    if not fitted.rows.system.data.timed:
        return []
    trials = [in_periods(fitted, c, most) for c in candidates if c.sort == "fault"]
    found = [t for t in trials if t is not None]
    return sorted(found, key=lambda t: -t.gain)[: limits.COMING]


def periods_of(trial: InitialCandidate) -> int:
    """Periods of what comes and goes; 0 of what lasts."""
    return 0 if trial.course is None else len(trial.course.periods)


def in_periods(
    fitted: Fitted, candidate: Candidate, most: float = np.inf
) -> InitialCandidate | None:
    """A fault as one that comes and goes, in so many periods at most; None where its degree shows
    no such course."""
    unknown = next((u for u in candidate.unknowns if u.null is not None), None)
    if unknown is None or unknown.null is None:
        return None
    columns = columns_of(fitted, candidate, {unknown.id: unknown.null}, {})
    if columns is None:
        return None
    looks = score_tests_at(fitted)
    degree, certainty = degree_course(fitted, columns[:, 0])
    # Held-out points are not looked at; a period reaches over those inside it.
    known = np.flatnonzero(np.isfinite(degree) & fitted.used)
    if len(known) < 4 * limits.SHORTEST:
        return None
    edges = np.linspace(0, len(known), min(limits.LONGEST_COURSE, len(known)) + 1).astype(int)
    weights = certainty[known]
    sums = np.add.reduceat(weights, edges[:-1])
    means = np.add.reduceat(weights * degree[known], edges[:-1]) / sums
    noise = _noise(means)
    segments = cut(means / noise, limits.STEP_PENALTY * float(np.log(len(means))))
    states = [apart(segments, odd) for odd in limits.ODD]
    some = [on for on in states if on.any() and not on.all()]
    states = [*some, *(_longest(segments, on) for on in some), *(_hull(on) for on in some)]
    means_ = _Means(known, edges, means, sums, noise)
    tried = {tuple(np.flatnonzero(on)): (segments, on) for on in states}
    ways = list(tried.values())
    if len(segments.first) > 1:
        ways.append(_begun(fitted, looks, unknown, columns[:, 0], means_))
    trials = [
        _trial(fitted, looks, candidate, unknown, columns[:, 0], means_, *way, levels)
        for way in ways
        for levels in (1, limits.MOST_LEVELS)
        if way[1].any() and not way[1].all()
    ]
    each = 0.5 * float(np.log(max(fitted.rows.groups, 2)))
    found = [t for t in trials if t is not None and t.course and len(t.course.periods) <= most]
    return max(found, key=lambda t: _likely(t, each), default=None)


def _longest(segments: Segments, on: np.ndarray) -> np.ndarray:
    """The longest period alone: the others may be noise."""
    first, last = max(runs_of(segments, on), key=lambda run: run[1] - run[0])
    inside: np.ndarray = (segments.first >= first) & (segments.first < last) & on
    return inside


def _hull(on: np.ndarray) -> np.ndarray:
    """One period from the first to the last: what is between may be noise as well."""
    there = np.flatnonzero(on)
    inside: np.ndarray = np.zeros(len(on), dtype=bool)
    inside[there[0] : there[-1] + 1] = True
    return inside


def _begun(
    fitted: Fitted, looks: Sequence[ScoreTest], unknown: Unknown, column: Array, means: _Means
) -> tuple[Segments, np.ndarray]:
    """One change for good, where that explains most: what faults do.

    Beside values that are free: a recalibration stands between what was before and what is since,
    and hides a part of both.
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
    gains = np.max([look.best_of(terms, each, low, high)[1] for look in looks], axis=0)
    first = np.array([0, begins[int(np.argmax(gains))]])
    length = np.diff(np.append(first, count))
    level = np.add.reduceat(means.value, first) / length / means.noise
    return Segments(first, level, length), np.array([False, True])


def _likely(trial: InitialCandidate, each: float) -> float:
    """Gain of a trial less the price of its periods and degrees.

    Of two that say the same, a fault that begins is likelier than one that was there and went.
    """
    course = trial.course
    assert course is not None
    first = int(np.flatnonzero(course.segment >= 0)[0])
    begins = first > 0 and course.periods[0].since > 0.0
    price = each * (limits.PERIOD_PRICE * len(course.periods) + course.levels)
    return trial.gain * (1.0 if begins else limits.PASSING) - price


@dataclass(frozen=True)
class _Means:
    """A course in means: means over points ``known[edges[i] : edges[i + 1]]``, their weights."""

    known: NDArray[np.intp]
    edges: NDArray[np.intp]
    value: Array
    weight: Array
    noise: float


def _trial(
    fitted: Fitted,
    looks: Sequence[ScoreTest],
    candidate: Candidate,
    unknown: Unknown,
    column: Array,
    means: _Means,
    segments: Segments,
    on: np.ndarray,
    most: int,
) -> InitialCandidate | None:
    """The fault with at most so many degrees; None where no period is left that lasts."""
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
    gain = max(look.best(term[:, None], -wide, wide)[1] for look in looks)
    return InitialCandidate(candidate=candidate, values=values, fixed={}, gain=gain, course=course)


def _joined(
    runs: Sequence[tuple[int, int]], number: NDArray[np.intp]
) -> Iterator[tuple[int, int, int]]:
    """Runs with the number of their level; what is between two of a level may be nothing."""
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

    NaN at points that no residual speaks of.
    """
    rows = fitted.rows
    n = len(rows.system.data)
    # What the model cannot explain at all counts little here as well.
    sound = column * student_weights(rows, fitted.residual, fitted.scale)
    weight = np.bincount(rows.point, column * sound, minlength=n).astype(float)
    moment = np.bincount(rows.point, sound * fitted.residual, minlength=n).astype(float)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Whether a point speaks of the degree is no matter of how far out it lies.
        spoken = np.bincount(rows.point, column**2, minlength=n).astype(float)
        # Of points that speak at all: where a module moves, only rounding is left of others.
        least = limits.FAINT * float(np.sum(spoken**2) / max(np.sum(spoken), 1e-300))
        degree: Array = np.where(spoken > least, -moment / weight, np.nan)
    return degree, weight


def _noise(means: Array) -> float:
    """Standard deviation of a course about its levels, robust against steps."""
    return white_noise(np.diff(means), 1) or float(np.std(means)) or 1.0
