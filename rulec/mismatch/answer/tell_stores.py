"""From fitted models to findings and places, as the terminal and the report show them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, Unknown
from rulec.mismatch.answer.tell import TOLD, sentence, titled, unit_of_size
from rulec.mismatch.answer.verdict import CERTAIN
from rulec.mismatch.evidence.steady.locate import periods_of
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.evidence.stores.locate import Suspect, region_in
from rulec.mismatch.evidence.stores.simulation_problem import Bench
from rulec.mismatch.evidence.stores.terms import driving, term_of, variables_of
from rulec.mismatch.result import Alternative, Estimate, Finding, Location, Period
from rulec.mismatch.search.stores.backward_elimination import Accepted, profile
from rulec.mismatch.search.stores.searcher import Searcher


def findings_of(
    searcher: Searcher, best: Fitted, accepted: tuple[Accepted, ...]
) -> tuple[Finding, ...]:
    """What was accepted, in the order of what it explains."""
    total = sum(a.gain for a in accepted) or 1.0
    found = [_finding(searcher, best, a, a.gain / total) for a in accepted]
    return tuple(sorted(found, key=lambda f: -f.closed))


def _finding(searcher: Searcher, best: Fitted, own: Accepted, share: float) -> Finding:
    bench, candidate = searcher.bench, own.candidate
    parameters = {u.name: _estimate(searcher, best, u) for u in candidate.unknowns if not u.fixed}
    others = tuple(
        Alternative(c.id, c.name, titled(bench.ruleset, c), odds * own.probability)
        for c, odds in own.others
        if odds * own.probability > TOLD
    )
    return Finding(
        candidate.id,
        candidate.sort,
        candidate.name,
        candidate.title,
        candidate.module,
        candidate.place,
        parameters,
        bench.builder.equation(candidate.module, best.ids, candidate.place),
        sentence(candidate, parameters, ()),
        candidate.action,
        candidate.source,
        own.probability,
        others,
        own.gain,
        own.rivals,
        period_of(bench, candidate, parameters),
        share,
        candidate.members,
    )


def period_of(
    bench: Bench, candidate: Candidate, parameters: Mapping[str, Estimate]
) -> tuple[Period, ...]:
    """When a fault that begins was there, and its degree."""
    onset = candidate.onset
    degree = next((u for u in candidate.unknowns if u.null is not None), None)
    if onset is None or degree is None:
        return ()
    first, last = (float(t) for t in bench.record.time[[0, -1]])
    found = parameters[degree.name]
    since = first + parameters[onset.name].value
    return (
        Period(
            since, last, found.value * degree.factor, found.u * degree.factor, unit_of_size(degree)
        ),
    )


def _estimate(searcher: Searcher, best: Fitted, unknown: Unknown) -> Estimate:
    value = best.values[unknown.id]
    low, high = profile(searcher, best, unknown.id)
    u = (high - low) / 3.92
    shown = [(v - unknown.offset) / unknown.factor for v in (value, low, high)]
    return Estimate(
        unknown.title, shown[0], u / unknown.factor, min(shown[1:]), max(shown[1:]), unknown.unit
    )


def location_of(bench: Bench, best: Fitted, finding: Finding) -> Location:
    """Where and when a finding shows; where it is open, also the places of what may be instead."""
    candidate = next(c for c in best.joined if c.id == finding.id)
    term = term_of(bench, best, candidate)
    variables = variables_of(bench, best, finding.module)
    region = region_in(term, driving(candidate, variables)) or region_in(term, variables)
    return Location(
        module=finding.module,
        place=finding.place,
        title=bench.ruleset.modules.get(finding.module, finding.module),
        share=finding.closed,
        region=() if finding.periods else region,
        periods=tuple((p.since, p.until) for p in finding.periods) or _when(bench, term),
        also=_elsewhere(bench, finding) if finding.probability < CERTAIN else (),
    )


def _when(bench: Bench, contribution: Array) -> tuple[tuple[float, float], ...]:
    """Spans of time, s, that hold most of a mismatch; none without a clock."""
    if not bench.record.timed:
        return ()
    return periods_of(bench.time + bench.record.time[0], contribution)


def _elsewhere(bench: Bench, finding: Finding) -> tuple[str, ...]:
    """Places of alternatives, each once, the likeliest first."""
    others = (bench.candidate(a.id) for a in finding.alternatives)
    places = dict.fromkeys(f"{c.module}.{c.place}" for c in others)
    return tuple(p for p in places if p != f"{finding.module}.{finding.place}")


def place_of(bench: Bench, fitted: Fitted, suspect: Suspect, also: tuple[Suspect, ...]) -> Location:
    """A place without a name for what is wrong there."""
    spot = suspect.spot
    contribution = np.where(bench.record.open, suspect.course**2, np.nan)
    variables = variables_of(bench, fitted, spot.module)
    return Location(
        module=spot.module,
        place=spot.place,
        title=spot.title,
        share=suspect.share,
        region=region_in(contribution, variables),
        periods=_when(bench, contribution),
        also=tuple(f"{s.spot.module}.{s.spot.place}" for s in also),
    )
