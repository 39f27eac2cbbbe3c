"""The posterior over sets of explanations, and what it says of each explanation."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rulec.effects.candidate import TIME, Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.evidence import Evidence, Names, id_of, name_of
from rulec.mismatch.result import Rival
from rulec.mismatch.search import limits
from rulec.mismatch.search.curve_found import Accepted
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.scan import coincide, holds, slopes_of
from rulec.mismatch.search.tolerance import Tolerance


def likeliest_of(odds: Mapping[Names, float]) -> Names:
    """The set of the largest log odds; of sets that are equal but for rounding, one by its name."""
    largest = max(odds.values())
    return max((names for names in odds if odds[names] > largest - limits.TIED), key=sorted)


@dataclass(frozen=True)
class Posterior:
    """Models of the refitted sets, and their log odds, nats."""

    evidence: Evidence
    models: Mapping[Names, Model]
    odds: Mapping[Names, float]

    @cached_property
    def sets(self) -> Mapping[Names, float]:
        """Their probabilities."""
        weight = np.exp(np.array(list(self.odds.values())) - max(self.odds.values()))
        return dict(zip(self.odds, (weight / weight.sum()).tolist(), strict=True))

    @cached_property
    def best(self) -> Names:
        """The most probable set; of terms over one driver at several places that are about as
        probable, one that a module type can hold."""
        best = likeliest_of(self.odds)
        for term in self.models[best].terms:
            if term.changed.may_follow(term.driver):
                continue
            rest, least = best - {term.name}, self.odds[best] + float(np.log(common.MENTIONED))
            near = {
                names: odds
                for names, odds in self.odds.items()
                if rest < names and len(names) == len(best) and odds > least
                for other in self.models[names].terms
                if other.name not in rest
                and other.driver == term.driver
                and other.changed.may_follow(other.driver)
            }
            best = likeliest_of(near) if near else best
        return best

    @property
    def selected(self) -> Names:
        """The most probable set; the empty one, where that is not unlikely."""
        return frozenset() if self.nothing >= common.MENTIONED else self.best

    @property
    def nothing(self) -> float:
        """Probability that no effect is missing."""
        return self.sets[frozenset()]

    @cached_property
    def tolerance(self) -> Tolerance:
        """How far readings may be off under the `selected` set."""
        return Tolerance(self.evidence, self.models[self.selected])

    @cached_property
    def _likely(self) -> dict[Names, Tolerance]:
        """The tolerance of each likely set."""
        likely = [n for n, p in self.sets.items() if n and p > limits.LIKELY_SET]
        return {n: Tolerance(self.evidence, self.models[n]) for n in likely}

    @cached_property
    def tolerated(self) -> tuple[Names, ...]:
        """Likely sets of terms that are within the errors of laws and sensors."""
        return tuple(n for n, tolerance in self._likely.items() if n == tolerance.tolerated)

    @property
    def unseen(self) -> float:
        """Probability that no missing effect shows.

        It includes sets of terms within the errors of laws and sensors and, unless another set is
        likely enough to be mentioned, those that move no reading by more than these errors.
        """
        others = {n: self.sets[n] for n in self._likely if n not in self.tolerated}
        nothing = self.nothing + sum(self.sets[n] for n in self.tolerated)
        if max(others.values(), default=0.0) >= common.MENTIONED:
            return nothing
        return nothing + sum(p * (1.0 - self._likely[n].shows) for n, p in others.items())

    @property
    def names(self) -> dict[str, float]:
        """Probability of each explanation, as the sum over the sets that contain it."""
        sets = self.sets
        every = sorted({name for names in sets for name in names})
        return {name: sum(p for names, p in sets.items() if name in names) for name in every}


def reported_names(posterior: Posterior) -> Names:
    """Members of the best set to report: those that are likelier present than not.

    Alternatives to a member count for it: each of several may be unlikely although one of them is
    certainly present. Terms within the accuracy of laws are not reported.

    Source: median probability model (Barbieri and Berger 2004).
    """
    best, sets = posterior.selected, posterior.sets
    likelier = set()
    for name in best - posterior.tolerance.tolerated:
        rest = best - {name}
        alike = [names for names in sets if rest < names and len(names) == len(best)]
        same = frozenset[str]().union(*(names - rest for names in alike))
        if sum(p for names, p in sets.items() if names & same) >= limits.LIKELIER:
            likelier.add(name)
    return frozenset(likelier)


def reported_setting(posterior: Posterior) -> Configuration:
    """The best set without the candidates that are not reported."""
    setting, reported = posterior.models[posterior.selected].setting, reported_names(posterior)
    for candidate in setting.joined:
        if name_of(setting, candidate) not in reported:
            setting = setting.leaving(candidate.id)
    return setting


def accepted_of(posterior: Posterior, name: str, candidate: Candidate) -> Accepted:
    """An explanation of the best set, with the odds of alternatives to it.

    Terms without a name that contain it as a special case are no other explanation.
    """
    best, sets, models = posterior.selected, posterior.sets, posterior.models
    rest, candidates, alike = best - {name}, candidates_of(posterior), alike_names(posterior, name)
    model = models[best]
    here = next((c for c in model.setting.joined if name_of(model.setting, c) == name), None)
    slopes = [] if here is None else slopes_of(model, here)
    every = {t.name: t for m in models.values() for t in m.terms} if slopes else {}
    curves = {n for n, t in every.items() if all(holds([t], s) for s in slopes)} - best
    own = sum(p for names, p in sets.items() if names & alike)
    others, shapeless = dict[str, float](), 0.0
    for names, probability in sets.items():
        if names & alike:
            continue
        if names & curves:
            shapeless += probability
            continue
        for other in names - best:
            if other in candidates:
                others[other] = others.get(other, 0.0) + probability
    ranked = sorted(others.items(), key=lambda o: -o[1])
    same = []
    for other, probability in ranked:
        there = models.get(rest | {other})
        if probability >= common.REPORTED and here is not None and there is not None:
            joined = there.setting.joined
            rival = next(c for c in joined if name_of(there.setting, c) == other)
            if coincide(posterior.evidence, model, here, there, rival):
                same.append(candidates[other].id)
    odds = tuple((candidates[n], p / own) for n, p in ranked)
    stands_out = posterior.tolerance.stand_out.get(candidate.id, 1.0)
    beside = max(odds for names, odds in posterior.odds.items() if names <= rest)
    return Accepted(
        candidate,
        max(posterior.odds[best] - beside, limits.LEAST_GAIN),
        odds,
        _rivals(posterior, name, beside),
        unnamed=max((1.0 - shapeless) / own - 1.0 - sum(p for _, p in odds), 0.0),
        shapeless=shapeless / own,
        inexact=limits.INEXACT * (1.0 - stands_out),
        same=frozenset(same),
    )


def _rivals(posterior: Posterior, name: str, beside: float) -> tuple[Rival, ...]:
    """The best alternative to an explanation, and its gain in the same place over the log odds
    `beside` of the other members of the best set.

    For a name it is a term without a name, for such a term the best name.
    """
    rest, term = posterior.selected - {name}, "~" in name
    there = {
        names: odds
        for names, odds in posterior.odds.items()
        if name not in names
        and (rest < names if term else names - rest)
        and all(("~" in n) is not term for n in names - rest)
    }
    if not there:
        return ()
    names = max(there, key=lambda n: there[n])
    title = "an unnamed term at the same place"
    if term:
        candidates = candidates_of(posterior)
        title = " and ".join(sorted(titled_with_module(candidates[n]) for n in names - rest))
    return (Rival(title, there[names] - beside),)


def alike_names(posterior: Posterior, name: str) -> frozenset[str]:
    """A name with its equivalents: the same fault with any course, terms without a name over the
    same driver at any place.

    Columns of such terms often coincide, and would share the probability of all of them.
    """
    _, mark, driver = name.rpartition("~")
    if not mark:
        return frozenset(n for names in posterior.odds for n in names if id_of(n) == id_of(name))
    if driver == TIME:
        return frozenset({name})
    return frozenset(n for names in posterior.odds for n in names if n.endswith(mark + driver))


def candidates_of(posterior: Posterior) -> dict[str, Candidate]:
    """All candidates of any set, by their names there."""
    settings = [model.setting for model in posterior.models.values()]
    return {name_of(setting, c): c for setting in settings for c in setting.joined}


def titled_with_module(candidate: Candidate) -> str:
    """A title that names the module once."""
    title, module = candidate.title, candidate.module
    return title if f"{module}." in title else f"{title} in {module}"
