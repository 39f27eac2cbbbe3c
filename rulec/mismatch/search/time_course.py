"""What begins, grows, or comes and goes in a search at settled points.

Periods are found on all points and transferred to means per operating state.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.evidence import Names, marked
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence, settled
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.screen import InitialCandidate
from rulec.mismatch.search import limits
from rulec.mismatch.search.grow_sets import Search
from rulec.mismatch.search.intermittent_fault import in_periods, intermittent
from rulec.mismatch.search.refit import Model


def coming_and_going(search: Search, model: Model) -> list[InitialCandidate]:
    """Faults that come and go beside a model, with their courses at means."""
    evidence, shut_out = settled(search.evidence), search.shut_out(model)
    free = [c for c in evidence.candidates if c.id not in shut_out]
    trials = intermittent(_on_all_points(evidence, model.setting), free)
    return [one for trial in trials for one in _at_means(evidence, trial)]


def _on_all_points(evidence: SteadyEvidence, setting: Configuration) -> Fitted:
    data = evidence.points.system.data
    return fit(evidence.points, setting.at_points(data.time), data.open, 0)


def _at_means(evidence: SteadyEvidence, trial: InitialCandidate) -> Iterator[InitialCandidate]:
    """A fault that comes and goes at means, unless these miss one of its degrees."""
    assert trial.course is not None
    course = trial.course.at_times(evidence.system.data.time)
    if set(range(course.levels)) <= set(course.segment.tolist()):
        yield replace(trial, course=course)


def ends_of(found: Sequence[InitialCandidate]) -> Array:
    """Ends of the periods, s, of the fault that gains most: a mean across one would blur it."""
    worth = [f for f in found if f.gain > limits.WORTH_A_CUT]
    best = max(worth, key=lambda f: f.gain, default=None)
    spans = best.course.periods if best is not None and best.course is not None else ()
    return np.unique(
        [end for span in spans for end in (span.since, np.nextafter(span.until, np.inf))]
    )


def grow_periods(search: Search, names: Names) -> None:
    """Refit a set with faults that come and go: one that begins may do so, and the likelier model
    is kept."""
    model = search.models[names]
    for trial in coming_and_going(search, model) if len(names) < common.LARGEST_SET else ():
        new = frozenset({marked(trial.candidate.id, trial.course)})
        search.join(names, new, trial.joined_to(model.setting))


def refine_onsets(search: Search, names: Names) -> None:
    """Find periods again beside all else, and move onsets while that is likelier: the onsets tried
    at first lie far apart."""
    evidence = settled(search.evidence)
    setting = search.models[names].setting
    for course in (c for c in setting.courses if not c.grows):
        fault = setting.candidate_of(course)
        rest = setting.leaving(fault.id)
        trial = in_periods(_on_all_points(evidence, rest), fault)
        for again in _at_means(evidence, trial) if trial is not None else ():
            model = search.models[names]
            search.keep(names, search.refit(again.joined_to(rest), model, model.terms))
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
