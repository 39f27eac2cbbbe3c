"""Candidate sets, those sets of explanations that are still possible: described, and refitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch import limits as common
from rulec.mismatch.candidate_sets import CandidateSet, Presence
from rulec.mismatch.evidence.steady.configuration import Configuration, Course, Span
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.search import limits
from rulec.mismatch.search.evidence import Term
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.best_set import candidates_of, titled_with_module
from rulec.mismatch.search.settled.geometry import Geometry
from rulec.mismatch.search.settled.grow_sets import Names, Posterior, begun
from rulec.mismatch.search.settled.nameless import terms


def possible_sets(posterior: Posterior) -> tuple[CandidateSet, ...]:
    """The sets that are still possible, the likeliest first."""
    sets = sorted(posterior.sets.items(), key=lambda s: (-s[1], sorted(s[0])))
    likely = [(n, p) for n, p in sets[: limits.SETS_STANDING] if p >= common.REPORTED]
    return tuple(_candidate_set(posterior, names, probability) for names, probability in likely)


def _candidate_set(posterior: Posterior, names: Names, probability: float) -> CandidateSet:
    model, known = posterior.models[names], candidates_of(posterior)
    setting = model.setting
    titles = {term.name: _in_words(term) for term in model.terms}
    titles |= {name: titled_with_module(known[name]) for name in names if name in known}
    return CandidateSet(
        names=tuple(sorted(names)),
        titles=tuple(titles[name] for name in sorted(names)),
        probability=probability,
        joined=tuple(c.id for c in setting.joined),
        values={name: float(value) for name, value in setting.values.items()},
        fixed={name: float(value) for name, value in setting.fixed.items()},
        periods=tuple(
            Presence(c.unknown, tuple((s.since, s.until, s.level) for s in c.periods), c.grows)
            for c in setting.courses
        ),
        terms=tuple((term.name, term.basis.length) for term in model.terms),
    )


def _in_words(term: Term) -> str:
    where = f"{term.changed.module}.{term.changed.place}"
    if term.basis.says:
        return f"{where} {term.basis.says}"
    return f"{where} follows {term.driver} in a way without a name"


@dataclass(frozen=True)
class Again:
    """Candidate sets and their refits to the means of operating states in `geometry`, in order."""

    geometry: Geometry
    sets: tuple[CandidateSet, ...]
    models: tuple[Model, ...]


def refitted_again(every: Rows, sets: Sequence[CandidateSet]) -> Again:
    """Refit sets from their earlier values, but for those with a term that switches with set
    points: its values at other set points are not known.

    Raises KeyError with the id of a candidate that the knowledge base does not have.
    """
    search = begun(every)
    plain = search.models[frozenset()]
    # Terms that switch have no name and length of their own.
    smooth = [t for t in terms(search.settled, plain) if not t.basis.says]
    named = {(t.name, t.basis.length): t for t in smooth}
    kept, models = [], []
    for one in sets:
        if any(not length for _, length in one.terms):
            continue
        own = tuple(named[name] for name in one.terms)
        first = search.refit(_setting(search.settled, one), plain, own)
        # The plain model has large errors where an effect is missing, and these would explain part
        # of that effect; the second refit starts from the errors of the set itself.
        models.append(search.refit(first.setting, first, own))
        kept.append(one)
    return Again(search.settled, tuple(kept), tuple(models))


def _setting(geometry: Geometry, one: CandidateSet) -> Configuration:
    system = geometry.rows.system
    known = {candidate.id: candidate for candidate in system.builder.candidates}
    return Configuration(
        joined=tuple(known[id_] for id_ in one.joined),
        values=one.values,
        fixed=one.fixed,
        courses=tuple(_course(period, system.data.time) for period in one.periods),
    )


def _course(period: Presence, time: Array) -> Course:
    spans = tuple(Span(*span) for span in period.spans)
    lasts = spans[-1].until >= float(time[-1])
    end = np.array([spans[-1].level if lasts else -1])
    risen = np.zeros(1) if period.grows else None
    return Course(period.unknown, end, spans, risen=risen).at_times(time)
