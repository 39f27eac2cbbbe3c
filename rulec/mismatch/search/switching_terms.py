"""Terms that switch where set points change, instead of faults that come and go.

An effect that comes and goes exactly with the set points is hardly a fault, which would not depend
on them: it is a law that the model lacks, such as a valve with play, or a change of flow pattern.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import gammaln

from rulec.effects.candidate import TIME
from rulec.mismatch.evidence.configuration import Course
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence, fit_of, settled
from rulec.mismatch.evidence.steady.operating_state_means import states_of
from rulec.mismatch.evidence.steady.terms import term_of, ways_at
from rulec.mismatch.evidence.term import Switching, Term
from rulec.mismatch.search import limits
from rulec.mismatch.search.grow_sets import Search, without
from rulec.mismatch.search.refit import Model


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

    The price is that of specifying the visits: a fault with few ends is cheaper.
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
        price(len(ends), len(begins) - 1),
    )
    for spot in system.builder.spots:
        if (spot.module, spot.place) == (fault.module, fault.place):
            for way in ways_at(fit_of(model.point), spot):
                term = term_of(evidence.rows, evidence.seen, spot.id, way, TIME, basis)
                if term is not None:
                    yield term


def price(ends: int, borders: int) -> float:
    """Cost of specifying which of some borders are ends, nats."""
    ways = gammaln(borders + 1) - gammaln(ends + 1) - gammaln(borders - ends + 1)
    return float(ways + np.log(borders + 1))
