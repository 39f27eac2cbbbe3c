"""Refine the onsets of lasting faults to all points: means lie far apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rulec.mismatch.evidence.steady.configuration import Course
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.onset import onset_of
from rulec.mismatch.search import limits


def with_refined_onset(fitted: Fitted, unknown: str) -> Fitted:
    """Refit with a better onset of one unknown, if it lasts to the end."""
    course = _course(fitted, unknown)
    if len(course.periods) != 1 or course.segment[-1] < 0:
        return fitted
    return _where_it_grows(fitted, unknown) if course.grows else _where_it_steps(fitted, course)


def _course(fitted: Fitted, unknown: str) -> Course:
    return next(c for c in fitted.setting.courses if c.unknown == unknown)


def _where_it_steps(fitted: Fitted, course: Course) -> Fitted:
    """Try points around an onset."""
    time = fitted.rows.system.data.time
    near = np.abs(time - course.periods[0].since)
    window = np.sort(np.argsort(near)[: 2 * limits.ONSET_POINTS])
    best = fitted
    for at in np.unique(np.linspace(window[0], window[-1], limits.ONSET_POINTS).astype(int)):
        moved = _since(best, course, float(time[at]))
        best = moved if moved.objective < best.objective else best
    return best


def _where_it_grows(fitted: Fitted, unknown: str) -> Fitted:
    """Gauss-Newton steps, each halved until it pays."""
    time = fitted.rows.system.data.time
    best = fitted
    for _ in range(limits.ONSET_POINTS):
        course = _course(best, unknown)
        since, step = course.periods[0].since, onset_of(best, course).step
        for share in (1.0, 0.5, 0.25):
            there = float(np.clip(since + share * step, time[0], time[-2]))
            trial = _since(best, course, there)
            if trial.objective < best.objective:
                best = trial
                break
        else:
            break
    return best


def _since(fitted: Fitted, course: Course, begin: float) -> Fitted:
    """Refit with another onset, s."""
    there = course.since(begin, fitted.rows.system.data.time)
    courses = tuple(there if c.unknown == course.unknown else c for c in fitted.setting.courses)
    return fit(
        fitted.rows,
        replace(fitted.setting, courses=courses),
        fitted.used,
        limits.HALF_STEPS,
        variance_inflation=fitted.variance_inflation,
    )
