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
from rulec_runtime.diagnosis.steady.causes import Cause, Other, rivals_of
from rulec_runtime.diagnosis.steady.combine import ONSET
from rulec_runtime.diagnosis.steady.degree_course import Course, Stack, stack_of
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints
from rulec_runtime.diagnosis.steady.findings import (
    Finding,
    Found,
    Period,
    behind_of,
    finding_of,
    findings_of,
)
from rulec_runtime.diagnosis.steady.growth import Growth, growth_of
from rulec_runtime.diagnosis.steady.isolate import accepted, shares
from rulec_runtime.diagnosis.steady.screen import may_fit
from rulec_runtime.recordings.plant_calendar import ENDED as OVER
from rulec_runtime.recordings.stationary import Timeline


def found_of(timeline: Timeline, ruleset: Ruleset, evaluated: EvaluatedPoints) -> Found:
    """Results of a part over a recording, by runs of stretches and by courses over all of them.

    One growing fault may replace the others, and each fault that is still present is extrapolated.
    """
    found = findings_of(timeline, ruleset, evaluated)
    judged = np.flatnonzero(evaluated.isolation.judged)
    if not evaluated.combined or not len(judged):
        return found
    own, end = evaluated.part.ruleset, float(timeline.until[-1])
    index = {fault.id: i for i, fault in enumerate(own.faults)}
    named = list(dict.fromkeys(index[f.fault.id] for f in found.findings))
    stack = stack_of(own, evaluated.plain, judged, end, named)
    courses = [] if stack is None else _explaining(stack, named, evaluated.isolation.chance)
    findings = found.findings
    if stack is not None and courses and not _is_reported(found, own.faults, courses[0]):
        one = _of_course(timeline, ruleset, evaluated, stack, courses)
        # In place of all that was reported during it.
        findings = [*(f for f in findings if _is_apart(f, one)), one]
        found = replace(found, unknown=[p for p in found.unknown if _is_apart(p, one)])
    elif courses:
        fault = own.faults[courses[0].fault]
        growth = growth_of(fault, courses[0], end)
        findings = [
            replace(f, growth=_now(f, growth)) if f.active and f.fault.id == fault.id else f
            for f in findings
        ]
    followed = [_followed(timeline, evaluated, findings, one, index) for one in findings]
    return replace(found, findings=followed)


def _is_apart(other: Finding | Period, one: Finding) -> bool:
    return other.until < one.since or other.since > one.until


def _now(one: Finding, growth: Growth | None = None) -> Growth:
    """Growth, or none that is known, with the present size as a finding has it."""
    blank = Growth(time=0.0, degree=0.0, lower=0.0, upper=0.0)
    return replace(
        growth or blank, time=one.until, degree=one.degree, lower=one.lower, upper=one.upper
    )


def _is_reported(found: Found, faults: Sequence[FaultSpec], course: Course) -> bool:
    """Whether runs of stretches say as much as a course: it goes in steps, and agrees with them."""
    if course.grows:
        return False
    degree, u = course.now
    # What remains after a fault that came and went must be as certain as a course, of many faults.
    certain = np.sqrt(-2.0 * np.log(limits.ALARM_PER_RECORDING / len(faults)))
    if degree < u * (certain if found.findings else common.THRESHOLD):
        return True
    half, fault = common.COVERAGE * u, faults[course.fault].id
    own = (f for f in found.findings if f.fault.id == fault and f.active)
    return any(f.lower - half <= degree <= f.upper + half for f in own)


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
    may = [i for i in may if stack.shown is None or i in stack.shown]
    some = sorted((i for i in may if np.isfinite(gain_of(i))), key=lambda i: -gain_of(i))
    least = -np.log(limits.ALARM_PER_RECORDING / max(len(some), 1))
    if not named and (not some or gain_of(some[0]) < least):
        return []
    # Faults that move the same readings gain the same to first order: rounding must not choose.
    last = gain_of(some[: limits.COURSES_TRIED][-1]) - limits.TIED if some else np.inf
    asked = dict.fromkeys((*(i for i in some if gain_of(i) > last), *named))
    each = [stack.course(i, ended=ended) for i in asked if i in some for ended in stack.ends()]
    tried = [c for c in each if c is not None]
    tried.sort(key=lambda c: -c.evidence - np.log(faults[c.fault].odds))
    best: dict[int, Course] = {}
    for course in tried:
        degree, u = course.now
        # One that has faded is told by runs of stretches.
        if course.left <= limit and degree > common.COVERAGE * u:
            best.setdefault(course.fault, course)
    sound = list(best.values())
    # Where even the likeliest course leaves too much, one that leaves less is no certain cause.
    return sound if sound and tried[0] is sound[0] and sound[0].gain >= least else []


def _of_course(
    timeline: Timeline,
    ruleset: Ruleset,
    evaluated: EvaluatedPoints,
    stack: Stack,
    courses: Sequence[Course],
) -> Finding:
    """The growing fault that explains all stretches best."""
    faults, best = evaluated.part.ruleset.faults, courses[0]
    last = int(stack.points[best.ended - 1])
    prior = np.log([faults[c.fault].odds for c in courses])
    evidence = np.array([c.evidence for c in courses])
    chance, alone = (shares(e[:, None])[:, 0].tolist() for e in (evidence + prior, evidence))
    named, *others = map(Other, (c.fault for c in courses), chance, alone)
    (degree, u), rivals = best.now, rivals_of(named, others)
    bounds = degree - common.COVERAGE * u, degree + common.COVERAGE * u
    cause = Cause(best.fault, degree, *bounds, named.probability, *rivals, (), ONSET)
    # The learned baseline contains the fault.
    blank = nothing_learned(evaluated.plain)
    plain = replace(evaluated, observed=evaluated.plain, baselines=blank)
    times = float(timeline.since[stack.points[best.onset]]), float(timeline.until[last])
    one = finding_of(ruleset, plain, cause, [last], times)
    if best.ended < len(stack.time):
        return replace(one, behind=OVER)
    growth = growth_of(faults[best.fault], best, stack.end)
    return replace(one, behind=behind_of(timeline, evaluated, [last]), growth=growth)


def _followed(
    timeline: Timeline,
    evaluated: EvaluatedPoints,
    findings: Sequence[Finding],
    one: Finding,
    index: dict[str, int],
) -> Finding:
    """A finding with its present size, if it is still there and its stretches show it."""
    if one.growth is not None or not one.active:
        return one
    isolation = evaluated.isolation
    there = isolation.judged.copy()
    for other in (f for f in findings if f is not one):
        there &= (timeline.since > other.until) | (timeline.until < other.since)
    run = np.flatnonzero(there & (timeline.since >= one.since))
    healthy = np.flatnonzero(there & ~isolation.deviating & (timeline.until < one.since))
    course = None
    if len(run) >= limits.POINTS_THAT_GROW:
        fault, every = index[one.fault.id], np.concatenate([healthy, run])
        stack = stack_of(evaluated.part.ruleset, evaluated.plain, every, one.until, [fault])
        onset = -1 if stack is None else int(np.searchsorted(stack.points, run[0]))
        if stack is not None and onset < len(stack.points):
            course = stack.course(fault, np.array([onset]))
    if course is None:
        return replace(one, growth=_now(one))
    growth = growth_of(one.fault, course, one.until)
    return replace(one, growth=growth if growth.grows else _now(one, growth))
