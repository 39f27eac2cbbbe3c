"""Faults that begin, grow, or come and go in a search at settled points.

Their periods are found on all points and transferred to means per operating state.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.column import Column, Names, Proposal
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence, settled
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.screen import InitialCandidate
from rulec.mismatch.search import limits
from rulec.mismatch.search.grow_sets import Search
from rulec.mismatch.search.intermittent_fault import in_periods, intermittent
from rulec.mismatch.search.refit import Model


def coming_and_going(search: Search, model: Model) -> list[Proposal]:
    """Faults that come and go beside a model."""
    evidence, shut_out = settled(search.evidence), search.shut_out(model)
    free = [c for c in evidence.candidates if c.id not in shut_out]
    return _at_means(evidence, intermittent(_on_all_points(evidence, model.setting), free))


def _on_all_points(evidence: SteadyEvidence, setting: Configuration) -> Fitted:
    data = evidence.points.system.data
    return fit(evidence.points, setting.at_points(data.time), data.open, 0)


def _at_means(evidence: SteadyEvidence, trials: Iterable[InitialCandidate]) -> list[Proposal]:
    """Faults that come and go, at means; without those of which the means miss a degree."""
    found = []
    for trial in trials:
        assert trial.course is not None
        candidate, course = trial.candidate, trial.course.at_times(evidence.system.data.time)
        if set(range(course.levels)) <= set(course.segment.tolist()):
            column = Column(
                candidate=candidate,
                amplitude=next(u for u in candidate.unknowns if u.null is not None),
                values=dict(trial.values),
                fixed={},
                rows=np.zeros(0),
                course=course,
            )
            found.append(Proposal(trial.gain, ((column, trial.values[course.names()[0]]),)))
    return found


def ends_of(found: Sequence[Proposal]) -> Array:
    """Ends of the periods, s, of the fault that gains most: a mean across one would blur it."""
    worth = [f for f in found if f.gain > limits.WORTH_A_CUT]
    best = max(worth, key=lambda f: f.gain, default=None)
    courses = [column.course for column, _ in best.starts] if best else []
    spans = [span for course in courses if course for span in course.periods]
    return np.unique(
        [end for span in spans for end in (span.since, np.nextafter(span.until, np.inf))]
    )


def grow_periods(search: Search, names: Names) -> None:
    """Refit a set with faults that come and go: one that begins may do so, and the likelier model
    is kept."""
    evidence, model = search.evidence, search.models[names]
    if len(names) < common.LARGEST_SET:
        for one in coming_and_going(search, model):
            for more, begin in evidence.beginnings(model.setting, (), [one]):
                search.join(names, more, begin)


def refine_onsets(search: Search, names: Names) -> None:
    """Find periods again beside all else, and move onsets while that is likelier: the onsets tried
    at first lie far apart."""
    evidence = settled(search.evidence)
    setting = search.models[names].setting
    for course in (c for c in setting.courses if not c.grows):
        fault = setting.candidate_of(course)
        rest = setting.leaving(fault.id)
        trial = in_periods(_on_all_points(evidence, rest), fault)
        for again in _at_means(evidence, [] if trial is None else [trial]):
            model = search.models[names]
            there = again.joined_to(rest)
            search.keep(names, search.refit(there, model, model.terms))
    for number, course in enumerate(search.models[names].setting.courses):
        steps = (*limits.ONSET_STEPS, *(limits.GROWING_STEPS if course.grows else ()))
        for step in steps if len(course.periods) == 1 else ():
            for way in (-step, step):
                while _moved(search, names, number, way, evidence.system.data.time):
                    pass


def _moved(search: Search, names: Names, number: int, by: float, time: Array) -> bool:
    """Is an onset `by` points later likelier? A growing fault may begin between two points."""
    model = search.models[names]
    course = model.setting.courses[number]
    since, points = course.periods[0].since, np.arange(len(time), dtype=float)
    at = float(np.interp(since, time, points) if course.grows else np.searchsorted(time, since))
    if not 0 < at + by < len(time) - course.grows or course.segment[-1] < 0:
        return False
    courses = list(model.setting.courses)
    courses[number] = course.since(float(np.interp(at + by, points, time)), time)
    before = search.odds[names]
    setting = replace(model.setting, courses=tuple(courses))
    search.keep(names, search.refit(setting, model, model.terms))
    return search.odds[names] > before
