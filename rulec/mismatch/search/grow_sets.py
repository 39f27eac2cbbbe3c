"""Grow sets of explanations from the best ones, refit each, and compare them."""

import contextlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from rulec_runtime.report.text import counted

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.evidence import Column, Evidence, Names, id_of
from rulec.mismatch.evidence.term import Term
from rulec.mismatch.search import limits
from rulec.mismatch.search.posterior import Posterior, likeliest_of
from rulec.mismatch.search.refit import Model, refitted
from rulec.mismatch.search.scan import Alike, beside, holds, scan, unnamed

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Search:
    """Refits sets of explanations and keeps the results.

    Of faults that are `alike`, only one may be joined.
    """

    evidence: Evidence
    alike: Alike = field(default_factory=dict)
    models: dict[Names, Model] = field(default_factory=dict)
    odds: dict[Names, float] = field(default_factory=dict)

    def refit(
        self, setting: Configuration, near: Model | None, own: tuple[Term, ...] = ()
    ) -> Model:
        """Refit a set from a similar one."""
        return refitted(self.evidence, setting, near, own)

    def keep(self, names: Names, model: Model) -> None:
        """Keep a model if it is the best one of its set so far."""
        odds = self.score(model)
        if odds > self.odds.get(names, -np.inf):
            self.models[names], self.odds[names] = model, odds

    def score(self, model: Model) -> float:
        """Evidence plus prior log odds, nats."""
        setting = model.setting
        number = max(len({c.id for c in self.evidence.candidates}), 1)
        prior = sum(
            limits.MISSING_ODDS + limits.SORT_ODDS[c.sort] - np.log(number) for c in setting.joined
        )
        prior -= limits.COMMON * sum(bool(c.members) for c in setting.joined)
        ends = sum(2 * len(c.periods) - 1 for c in setting.courses)
        prior -= ends * float(np.log(common.ONSETS))
        count = max(self.evidence.term_count, 1)
        prior += len(model.terms) * (limits.MISSING_ODDS + limits.TERM_ODDS - float(np.log(count)))
        prior -= sum(term.basis.penalty for term in model.terms)
        return model.evidence + float(prior)

    @property
    def likeliest(self) -> Names:
        """The set of the largest log odds."""
        return likeliest_of(self.odds)

    def shut_out(self, model: Model) -> frozenset[str]:
        """Ids of joined candidates and of faults like one of these: none of them can be joined."""
        joined = {c.id for c in model.setting.joined}
        return frozenset(joined).union(*(self.alike.get(name, ()) for name in joined))

    def join(self, names: Names, more: Names, begin: Configuration) -> None:
        """Refit a set with more explanations from a setting, if that has finite slopes."""
        model = self.models[names]
        with contextlib.suppress(np.linalg.LinAlgError):
            self.keep(names | more, self.refit(begin, model, model.terms))

    def posterior(self) -> Posterior:
        """The posterior over all sets."""
        return Posterior(self.evidence, dict(self.models), dict(self.odds))


def grown(
    search: Search,
    progress: Progress,
    steps: Sequence[Callable[[Search, Names], None]],
    *,
    apart: bool = False,
) -> None:
    """Grow the best sets, each by all steps, until no new one is among the best.

    If `apart`, sets with and without terms are grown separately.
    """
    done: set[Names] = set()
    for number in range(1, limits.SEARCH_ROUNDS + 1):
        best = sorted(search.odds, key=lambda names: -search.odds[names])
        kinds = [bool(search.models[names].terms) and apart for names in best]
        own = ([n for n, k in zip(best, kinds, strict=True) if k is kind] for kind in (False, True))
        todo = [n for kind in own for n in kind[: limits.SETS_GROWN] if n not in done]
        if not todo:
            break
        for names in todo:
            done.add(names)
            tried = counted(len(search.odds), "combination")
            progress(f"round {number}: {tried} tested")
            for step in steps:
                step(search, names)


def grow(search: Search, names: Names) -> None:
    """Refit a set with the candidates that gain most beside it."""
    evidence, model = search.evidence, search.models[names]
    if len(names) < evidence.most and (evidence.beside_terms or not model.terms):
        shut_out = search.shut_out(model)
        free = [c for c in evidence.candidates if c.id not in shut_out]
        join_columns(search, names, evidence.columns(model.point, free))


def join_columns(search: Search, names: Names, every: Iterable[Column]) -> None:
    """Refit a set with those of some columns and pairs of columns that gain most beside it."""
    evidence, model = search.evidence, search.models[names]
    every = [c for c in every if not holds(model.terms, c.rows)]
    found = scan(evidence, model, every, search.alike, common.SETS_REFITTED)
    new = [one for one in found if names | one.names not in search.odds]
    for more, begin in evidence.starting_points(model.setting, every, new):
        search.join(names, more, begin)


def grow_terms(search: Search, names: Names) -> None:
    """Refit a set with the terms without a name that gain most beside it."""
    if len(names) < common.LARGEST_SET:
        join_terms(search, names, search.evidence.terms(search.models[names].point))


def join_terms(search: Search, names: Names, every: Sequence[Term]) -> None:
    """Refit a set with the terms without a name that gain most beside it."""
    model = search.models[names]
    for gain, term in unnamed(search.evidence, model, beside(model, every), limits.TERMS_REFITTED):
        if gain > limits.WORTH_A_REFIT and names | {term.name} not in search.odds:
            own = (*model.terms, term)
            search.keep(names | {term.name}, search.refit(model.setting, model, own))


def prune(search: Search, names: Names) -> None:
    """Refit a set without each of its members: from here even a known set may be refitted better,
    as its periods and values were found without the others."""
    model = search.models[names]
    if len(names) < 2:
        return
    for candidate in model.setting.joined:
        with contextlib.suppress(np.linalg.LinAlgError):
            less = search.refit(model.setting.leaving(candidate.id), model, model.terms)
            search.keep(without(names, candidate), less)
    for term in model.terms:
        own = tuple(t for t in model.terms if t is not term)
        search.keep(names - {term.name}, search.refit(model.setting, model, own))


def without(names: Names, candidate: Candidate) -> Names:
    """A set without one candidate, whatever its course."""
    return frozenset(n for n in names if id_of(n) != candidate.id)
