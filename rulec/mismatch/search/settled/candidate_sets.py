"""Sets of explanations that are still possible: written down, and refitted again."""

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
from rulec.mismatch.search.settled.nameless import smooth, terms
from rulec.mismatch.search.settled.sets import Names, Posterior, begun


def standing_of(posterior: Posterior) -> tuple[CandidateSet, ...]:
    """The sets that are still possible, the likeliest first."""
    sets = sorted(posterior.sets.items(), key=lambda s: (-s[1], sorted(s[0])))
    likely = [(n, p) for n, p in sets[: limits.SETS_STANDING] if p >= common.REPORTED]
    return tuple(_standing(posterior, names, probability) for names, probability in likely)


def _standing(posterior: Posterior, names: Names, probability: float) -> CandidateSet:
    model, known = posterior.models[names], candidates_of(posterior)
    setting = model.setting
    by_name = {term.name: term for term in model.terms}
    ordered = tuple(sorted(names))
    titles = (
        titled_with_module(known[n]) if n in known else _in_words(by_name[n]) for n in ordered
    )
    return CandidateSet(
        names=ordered,
        titles=tuple(titles),
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
    """A term without a name."""
    where = f"{term.changed.module}.{term.changed.place}"
    if term.basis.says:
        return f"{where} {term.basis.says}"
    return f"{where} follows {term.driver} in a way without a name"


@dataclass(frozen=True)
class Again:
    """Sets refitted to the means of operating states that `geometry` has, in order."""

    geometry: Geometry
    sets: tuple[CandidateSet, ...]
    models: tuple[Model, ...]


def refitted_again(every: Rows, sets: Sequence[CandidateSet]) -> Again:
    """Sets refitted from where they were; without those of which a term switched with set points,
    for it is not known what it does at others.

    Raises KeyError with the id of a candidate that the knowledge base does not have.
    """
    search = begun(every)
    plain = search.models[frozenset()]
    named = {(t.name, t.basis.length): t for t in smooth(terms(search.settled, plain))}
    kept, models = [], []
    for one in sets:
        if any(not length for _, length in one.terms):
            continue
        own = tuple(named[name] for name in one.terms)
        first = search.refit(_setting(search.settled, one), plain, own)
        # With the sizes of errors of the plain model, which are large where something is missing,
        # values end where those errors explain a part of it; with their own sizes they do not.
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
