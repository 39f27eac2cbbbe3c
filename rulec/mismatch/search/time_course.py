"""What begins, grows, or comes and goes in a search at settled points.

Periods are found on all points and transferred to means per operating state.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.special import gammaln

from rulec.effects.candidate import TIME
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.configuration import Configuration, Course
from rulec.mismatch.evidence.evidence import Names, marked
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence, fit_of, settled
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.operating_state_means import states_of
from rulec.mismatch.evidence.steady.screen import InitialCandidate, ways_at
from rulec.mismatch.evidence.steady.terms import term_of
from rulec.mismatch.evidence.term import Switching, Term
from rulec.mismatch.search import limits
from rulec.mismatch.search.grow_sets import Search, without
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


# Terms that switch where set points change, instead of faults that come and go.
#
# An effect that comes and goes exactly with the set points is hardly a fault, which would not
# depend on them: it is a law that the model lacks, such as a valve with play, or a change of flow
# pattern.


def refit_switching_terms(search: Search) -> None:
    """In the best sets, try a term that changes with set points in the place of each fault that
    comes and goes."""
    evidence = settled(search.evidence)
    for names in sorted(search.odds, key=lambda n: -search.odds[n])[: limits.SETS_SWITCHED]:
        model = search.models[names]
        for course in model.setting.courses:
            rest = without(names, model.setting.candidate_of(course))
            if course.grows or rest not in search.models:
                continue
            near = search.models[rest]
            for term in with_set_points(evidence, model, course):
                own = (*near.terms, term)
                search.keep(rest | {term.name}, search.refit(near.setting, near, own))


def with_set_points(evidence: SteadyEvidence, model: Model, course: Course) -> Iterator[Term]:
    """Terms at the place of a fault that comes and goes, on or off during each visit of an
    operating state, as most of its points are.

    The penalty is that of specifying the visits: a fault with few ends is cheaper.
    """
    system, fault = evidence.points.system, model.setting.candidate_of(course)
    time = system.data.time
    new = np.diff(states_of(system), prepend=-1) != 0
    visits, begins = np.cumsum(new) - 1, np.flatnonzero(new)
    degree = course.at_times(time).degrees(model.setting.values)
    largest = float(np.max(np.abs(degree), initial=0.0))
    if largest == 0.0:
        return
    here = np.bincount(visits, degree / largest) / np.bincount(visits)
    there = np.round(here)
    ends = np.flatnonzero(np.diff(there) != 0) + 1
    if not len(ends):
        return
    basis = Switching(
        time[begins[ends]],
        there[np.append(0, ends)],
        "comes and goes only where set points change, which a fault would not know of",
        penalty_of(len(ends), len(begins) - 1),
    )
    for location in system.builder.locations:
        if (location.module, location.place) == (fault.module, fault.place):
            for way in ways_at(fit_of(model.point), location):
                term = term_of(evidence.rows, evidence.open, location.id, way, TIME, basis)
                if term is not None:
                    yield term


def penalty_of(ends: int, borders: int) -> float:
    """Cost of specifying which of some borders are ends, nats."""
    ways = gammaln(borders + 1) - gammaln(ends + 1) - gammaln(borders - ends + 1)
    return float(ways + np.log(borders + 1))
