"""Growing faults: found over all stretches together, and followed up to the present.

Source: own derivation, docs/method.md.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.baseline import nothing_learned
from rulec_runtime.diagnosis.steady.causes import Cause
from rulec_runtime.diagnosis.steady.combine import ONSET
from rulec_runtime.diagnosis.steady.degree_course import Course, Stack, stack_of
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints
from rulec_runtime.diagnosis.steady.findings import (
    Finding,
    Found,
    behind_of,
    finding_of,
    findings_of,
)
from rulec_runtime.diagnosis.steady.growth import Growth, growth_of
from rulec_runtime.diagnosis.steady.isolate import accepted, shares
from rulec_runtime.diagnosis.steady.rivals import Other, rivals_of
from rulec_runtime.diagnosis.steady.screen import may_fit
from rulec_runtime.recordings.stationary import Timeline


def found_of(timeline: Timeline, ruleset: Ruleset, evaluated: EvaluatedPoints) -> Found:
    """Results of a part over a recording, by runs of stretches and by courses over all of them.

    One growing fault may replace the others, and each fault that is still present is extrapolated.
    """
    found = findings_of(timeline, ruleset, evaluated)
    judged = np.flatnonzero(evaluated.isolation.judged)
    if not evaluated.combined or not len(judged):
        return found
    faults = evaluated.part.ruleset.faults
    place = {fault.id: i for i, fault in enumerate(faults)}
    named = list(dict.fromkeys(place[f.fault.id] for f in found.findings))
    stack = stack_of(
        evaluated.part.ruleset, evaluated.plain, judged, float(timeline.until[-1]), named
    )
    courses = [] if stack is None else _explaining(stack, named, evaluated.isolation.chance)
    if stack is not None and courses and not _is_reported(found, faults, courses[0]):
        found = _with_the_best(timeline, ruleset, evaluated, found, stack, courses)
    elif courses:
        growth = growth_of(faults[courses[0].fault], courses[0], float(timeline.until[-1]))
        found = _with_growth(found, faults[courses[0].fault].id, growth)
    findings = [_followed(timeline, evaluated, found, one, place) for one in found.findings]
    return replace(found, findings=findings)


def _is_reported(found: Found, faults: Sequence[FaultSpec], course: Course) -> bool:
    """Whether runs of stretches say as much as a course: it goes in steps, and agrees with them."""
    if course.grows:
        return False
    degree, u = course.now
    own = [f for f in found.findings if f.fault.id == faults[course.fault].id]
    # What remains after a fault that came and went must be as certain as a course, of many faults.
    certain = np.sqrt(-2.0 * np.log(limits.ALARM_PER_RECORDING / len(faults)))
    if degree < u * (certain if found.findings else common.THRESHOLD):
        return True
    return any(
        f.lower - common.COVERAGE * u <= degree <= f.upper + common.COVERAGE * u
        for f in own
        if f.active
    )


def _with_growth(found: Found, fault: str, growth: Growth) -> Found:
    findings = [
        replace(
            f, growth=replace(growth, time=f.until, degree=f.degree, lower=f.lower, upper=f.upper)
        )
        if f.active and f.fault.id == fault
        else f
        for f in found.findings
    ]
    return replace(found, findings=findings)


def _in_place(found: Found, one: Finding, since: float) -> Found:
    """A finding in place of all that was reported during it."""
    return replace(
        found,
        findings=[*(f for f in found.findings if f.until < since), one],
        unknown=[p for p in found.unknown if p.until < since],
    )


def _explaining(stack: Stack, named: Sequence[int], chance: float) -> list[Course]:
    """Significant courses of one fault each that explain all stretches, the best first; faults
    `named` so far are tried as well."""
    faults = stack.test.ruleset.faults
    gain_of = cache(stack.gain_at_first)
    # Where no course gains enough even if it fits, it would cost too much to ask which ones fit.
    if not named and max(map(gain_of, range(len(faults)))) < -np.log(limits.ALARM_PER_RECORDING):
        return []
    limit = accepted(stack.test.freedom, limits.PARTS_OF_A_COURSE, chance)
    may = np.flatnonzero(may_fit(stack.test, limit).any(axis=1)).tolist()
    gains = {i: gain_of(i) for i in may}
    some = [i for i, gain in gains.items() if np.isfinite(gain)]
    most = sorted(some, key=lambda i: -gains[i])[: limits.COURSES_TRIED]
    least = -np.log(limits.ALARM_PER_RECORDING / max(len(some), 1))
    if not named and (not most or gains[most[0]] < least):
        return []
    tried = [stack.course(i) for i in dict.fromkeys((*most, *named)) if i in gains]
    sound = [c for c in tried if c is not None and c.left <= limit]
    sound.sort(key=lambda c: -c.evidence - np.log(faults[c.fault].odds))
    if not sound or sound[0].gain < least:
        return []
    return sound


def _with_the_best(
    timeline: Timeline,
    ruleset: Ruleset,
    evaluated: EvaluatedPoints,
    found: Found,
    stack: Stack,
    courses: Sequence[Course],
) -> Found:
    """Results of a part with a growing fault in place of all that was reported during it."""
    faults, best = evaluated.part.ruleset.faults, courses[0]
    prior = np.log([faults[c.fault].odds for c in courses])
    evidence = np.array([c.evidence for c in courses])
    chance, alone = (shares(e[:, None])[:, 0] for e in (evidence + prior, evidence))
    named, *others = (
        Other(c.fault, float(p), float(q)) for c, p, q in zip(courses, chance, alone, strict=True)
    )
    rivals, remote = rivals_of(named, others)
    since = float(timeline.since[stack.points[best.onset]])
    until = float(timeline.until[stack.points[-1]])
    cause = Cause(
        best.fault,
        best.now[0],
        best.now[0] - common.COVERAGE * best.now[1],
        best.now[0] + common.COVERAGE * best.now[1],
        named.probability,
        rivals,
        remote,
        (),
        ONSET,
    )
    # The learned baseline contains the fault.
    plain = replace(evaluated, observed=evaluated.plain, baselines=nothing_learned(evaluated.plain))
    last = int(stack.points[-1])
    one = finding_of(ruleset, plain, cause, [last], (since, until))
    growth = growth_of(faults[best.fault], best, stack.end)
    one = replace(one, behind=behind_of(timeline, evaluated, [last]), growth=growth)
    return _in_place(found, one, since)


def _followed(
    timeline: Timeline,
    evaluated: EvaluatedPoints,
    found: Found,
    one: Finding,
    place: dict[str, int],
) -> Finding:
    """A finding with its present size, if it is still there and its stretches show it."""
    if one.growth is not None or not one.active:
        return one
    others = [f for f in found.findings if f is not one]
    now = Growth(time=one.until, degree=one.degree, lower=one.lower, upper=one.upper)
    isolation = evaluated.isolation
    here = isolation.judged & (timeline.since >= one.since)
    before = isolation.judged & ~isolation.deviating & (timeline.until < one.since)
    for other in others:
        meets = (timeline.since <= other.until) & (timeline.until >= other.since)
        here, before = here & ~meets, before & ~meets
    run, healthy = np.flatnonzero(here), np.flatnonzero(before)
    if len(run) < limits.POINTS_THAT_GROW:
        return replace(one, growth=now)
    fault = place[one.fault.id]
    stack = stack_of(
        evaluated.part.ruleset, evaluated.plain, np.concatenate([healthy, run]), one.until, [fault]
    )
    onset = -1 if stack is None else int(np.searchsorted(stack.points, run[0]))
    if stack is None or onset >= len(stack.points):
        return replace(one, growth=now)
    course = stack.course(fault, np.array([onset]))
    if course is None:
        return replace(one, growth=now)
    growth = growth_of(one.fault, course, one.until)
    if not growth.grows:
        growth = replace(growth, degree=one.degree, lower=one.lower, upper=one.upper)
    return replace(one, growth=growth)
