"""From numbers to findings: parameters as shown, sentences, alternatives, regions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset

from rulec.effects.candidate import Candidate, Unknown
from rulec.mismatch.answer.wording import quantity
from rulec.mismatch.evidence.steady.configuration import HIDDEN
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.locate import periods_of, region_of, variables_of
from rulec.mismatch.inference.interval import profile
from rulec.mismatch.result import Alternative, Estimate, Finding, Location, Period
from rulec.mismatch.search.accepted import Accepted
from rulec.mismatch.search.compete import Contestant

TOLD = 0.02
"""Alternatives less probable than this are not told."""


def findings_of(best: Contestant, accepted: tuple[Accepted, ...]) -> tuple[Finding, ...]:
    """What was accepted and has a name, in the order of what it explains."""
    named = (r for r in accepted if r.trial.candidate.sort != HIDDEN)
    shares = shares_of(accepted)
    found = [_finding(best, record, shares[record.trial.candidate.id]) for record in named]
    return tuple(sorted(found, key=lambda f: -f.closed))


def shares_of(accepted: tuple[Accepted, ...]) -> dict[str, float]:
    """What each explanation has of the gain of all."""
    total = sum(r.gain for r in accepted) or 1.0
    return {r.trial.candidate.id: r.gain / total for r in accepted}


def _finding(best: Contestant, record: Accepted, share: float) -> Finding:
    fitted = best.fitted
    # As it is by now: more of it may be searched for than at first.
    candidate = next(c for c in fitted.setting.joined if c.id == record.trial.candidate.id)
    parameters = {
        u.name: _estimate(fitted, u)
        for u in candidate.unknowns
        if not u.fixed and u.id not in fitted.setting.in_periods
    }
    periods = _periods(fitted, candidate)
    certain = 1.0 / (1.0 + sum(record.odds))
    others = tuple(
        Alternative(
            t.candidate.id,
            t.candidate.name,
            titled(fitted.rows.system.ruleset, t.candidate),
            o * certain,
        )
        for t, o in zip(record.others, record.odds, strict=True)
        if o * certain > TOLD
    )
    system = fitted.rows.system
    return Finding(
        candidate.id,
        candidate.sort,
        candidate.name,
        candidate.title,
        candidate.module,
        candidate.place,
        parameters,
        system.builder.equation(candidate.module, fitted.setting.ids, candidate.place),
        sentence(candidate, parameters, periods),
        candidate.action,
        candidate.source,
        certain,
        tuple(sorted(others, key=lambda a: -a.probability)),
        record.gain,
        record.rivals,
        periods,
        share,
        candidate.members,
    )


def titled(ruleset: Ruleset, candidate: Candidate) -> str:
    """An explanation and where, in a few words."""
    module = ruleset.modules.get(candidate.module, candidate.module)
    where = ", ".join(candidate.members) or f"{candidate.module}: {module}"
    return f"{candidate.title} ({where}, {candidate.place})"


def _estimate(fitted: Fitted, unknown: Unknown) -> Estimate:
    value = fitted.setting.values[unknown.id]
    low, high = profile(fitted, unknown.id)
    u = max(fitted.u(unknown.id), (high - low) / 3.92)
    shown = [(v - unknown.offset) / unknown.factor for v in (value, low, high)]
    return Estimate(
        unknown.title, shown[0], u / unknown.factor, min(shown[1:]), max(shown[1:]), unknown.unit
    )


def _periods(fitted: Fitted, candidate: Candidate) -> tuple[Period, ...]:
    unknowns = {u.id: u for u in candidate.unknowns}
    found = []
    for course in fitted.setting.courses:
        if course.unknown not in unknowns:
            continue
        for span in course.periods:
            name = course.names()[span.level]
            degree = fitted.setting.values[name]
            size = unit_of_size(unknowns[course.unknown])
            found.append(Period(span.since, span.until, degree, fitted.u(name), size))
    return tuple(found)


def unit_of_size(degree: Unknown) -> str:
    """The unit of a degree that is no share."""
    return "" if degree.unit == "%" else degree.unit


def sentence(
    candidate: Candidate, parameters: Mapping[str, Estimate], periods: tuple[Period, ...]
) -> str:
    """The sentence for the operator with its slots filled."""
    slots = {name: quantity(estimate) for name, estimate in parameters.items()}
    for unknown in candidate.unknowns:
        slots.setdefault(unknown.name, _of_periods(periods) if periods else unknown.title)
    slots |= {"degree": slots.get("x", ""), "where": candidate.place}
    text = candidate.text
    for name, value in slots.items():
        text = text.replace("{" + name + "}", value)
    return text


def _of_periods(periods: tuple[Period, ...]) -> str:
    degrees = [p.degree for p in periods]
    low, high = min(degrees), max(degrees)
    if periods[0].unit:
        ends = dict.fromkeys(f"{end:.3g}" for end in (low, high))
        return f"{' to '.join(ends)} {periods[0].unit}"
    if high - low < 0.005:
        return f"{100.0 * high:.1f} %"
    return f"{100.0 * low:.1f} to {100.0 * high:.1f} %"


def term_of(fitted: Fitted, candidate: Candidate) -> Array:
    """What a candidate changes in the residuals, squared and summed per point, shape (n,)."""
    system = fitted.rows.system
    without = fitted.setting.leaving(candidate.id)
    modules, at = system.reached(candidate.observers), fitted.predicted
    with_it = system.flows(fitted.setting, modules=modules, at=at).values
    bare = system.flows(without, modules=modules, at=at).values
    change = {
        i: np.nan_to_num(a - b)
        for i, (a, b) in enumerate(zip(with_it, bare, strict=True))
        if np.isfinite(a - b).any()
    }
    rows = fitted.rows.column(fitted.maps, change)
    squares: Array = np.bincount(fitted.rows.point, rows**2, len(system.data)).astype(float)
    return squares


def location_of(best: Contestant, finding: Finding) -> Location:
    """Where and when a finding shows."""
    fitted = best.fitted
    system = fitted.rows.system
    candidate = next(c for c in fitted.setting.joined if c.id == finding.id)
    term = np.where(fitted.used, term_of(fitted, candidate), np.nan)
    variables = variables_of(system, finding.module)
    drivers = {d: variables[d] for d in candidate.drivers.values() if d in variables}
    region = region_of(system, term, drivers) or region_of(system, term, variables)
    periods = tuple((p.since, p.until) for p in finding.periods)
    return Location(
        module=finding.module,
        place=finding.place,
        title=system.ruleset.modules.get(finding.module, finding.module),
        share=finding.closed,
        region=() if periods else region,
        periods=periods or (periods_of(system.data.time, term) if system.data.timed else ()),
    )
