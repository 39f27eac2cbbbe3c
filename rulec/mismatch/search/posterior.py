"""The posterior over sets of explanations, and what it says of each explanation."""

from collections.abc import Iterator, Mapping
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
    """Models of the refitted sets, their log odds, nats, and their probabilities."""

    evidence: Evidence
    models: Mapping[Names, Model]
    odds: Mapping[Names, float]
    sets: Mapping[Names, float]

    @property
    def best(self) -> Names:
        """The most probable set."""
        return likeliest_of(self.odds)

    @property
    def told(self) -> Names:
        """The most probable set; the empty one, where that is not unlikely."""
        return frozenset() if self.nothing >= common.MENTIONED else self.best

    @property
    def nothing(self) -> float:
        """Probability that no effect is missing."""
        return self.sets[frozenset()]

    @cached_property
    def tolerance(self) -> Tolerance:
        """How far readings may be off under the set `told`."""
        return self._tolerance(self.told)

    def _tolerance(self, names: Names) -> Tolerance:
        return Tolerance(self.evidence, self.models[names])

    @property
    def _likely(self) -> dict[Names, float]:
        return {n: p for n, p in self.sets.items() if n and p > limits.LIKELY_SET}

    @cached_property
    def within(self) -> tuple[Names, ...]:
        """Likely sets of terms that are within the errors of laws and sensors."""
        return tuple(n for n in self._likely if n == self._tolerance(n).within)

    @property
    def unseen(self) -> float:
        """Probability that no missing effect shows.

        It includes sets of terms within the errors of laws and sensors and, unless another set is
        likely enough to be mentioned, those that move no reading by more than these errors.
        """
        others = {n: p for n, p in self._likely.items() if n not in self.within}
        nothing = self.nothing + sum(self._likely[names] for names in self.within)
        if max(others.values(), default=0.0) >= common.MENTIONED:
            return nothing
        shown = (self._tolerance(n).shows for n in others)
        hidden = (p * (1.0 - share) for p, share in zip(others.values(), shown, strict=True))
        return nothing + sum(hidden)

    @property
    def names(self) -> dict[str, float]:
        """Probability of each explanation, as the sum over the sets that contain it."""
        sets = self.sets
        every = sorted({name for names in sets for name in names})
        return {name: sum(p for names, p in sets.items() if name in names) for name in every}


def posterior(
    evidence: Evidence, models: Mapping[Names, Model], odds: Mapping[Names, float]
) -> Posterior:
    """The posterior over refitted sets."""
    weight = np.exp(np.array(list(odds.values())) - max(odds.values()))
    sets = dict(zip(odds, (weight / weight.sum()).tolist(), strict=True))
    return Posterior(evidence, dict(models), dict(odds), sets)


def reported_names(posterior: Posterior) -> Names:
    """Members of the best set to report: those that are likelier present than not.

    Alternatives to a member count for it: each of several may be unlikely although one of them is
    certainly present. Terms within the accuracy of laws are not reported.

    Source: median probability model (Barbieri and Berger 2004).
    """
    best, sets = posterior.told, posterior.sets
    kept = set()
    for name in best - posterior.tolerance.within:
        rest = best - {name}
        alike = [names for names in sets if rest < names and len(names) == len(best)]
        same = frozenset[str]().union(*(names - rest for names in alike))
        if sum(p for names, p in sets.items() if names & same) >= limits.LIKELIER:
            kept.add(name)
    return frozenset(kept)


def reported_setting(posterior: Posterior) -> Configuration:
    """The best set without the candidates that are not reported."""
    setting, reported = posterior.models[posterior.told].setting, reported_names(posterior)
    for candidate in setting.joined:
        if name_of(setting, candidate) not in reported:
            setting = setting.leaving(candidate.id)
    return setting


def accepted_of(posterior: Posterior, name: str, candidate: Candidate) -> Accepted:
    """An explanation of the best set, with the odds of alternatives to it."""
    best, sets = posterior.told, posterior.sets
    alike = alike_names(posterior, name)
    own = sum(p for names, p in sets.items() if names & alike)
    known = candidates_of(posterior)
    others: dict[str, float] = {}
    shapeless, curves = 0.0, _curves_like(posterior, name)
    for names, probability in sets.items():
        if names & alike:
            continue
        if names & curves:
            shapeless += probability
            continue
        for other in names - best:
            if other in known:
                others[other] = others.get(other, 0.0) + probability
    ranked = sorted(others.items(), key=lambda o: -o[1])
    odds = tuple((known[n], p / own) for n, p in ranked)
    named = sum(p for _, p in odds)
    stands_out = posterior.tolerance.stand_out.get(candidate.id, 1.0)
    same = [n for n, p in ranked if p >= common.REPORTED and _coincides(posterior, name, n)]
    return Accepted(
        candidate,
        max(posterior.odds[best] - _beside(posterior, name), limits.LEAST_GAIN),
        odds,
        tuple(_rivals(posterior, name)),
        unnamed=max((1.0 - shapeless) / own - 1.0 - named, 0.0),
        shapeless=shapeless / own,
        inexact=limits.INEXACT * (1.0 - stands_out),
        same={known[n].id: {} for n in same},
    )


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


def _curves_like(posterior: Posterior, name: str) -> frozenset[str]:
    """Terms without a name that contain an explanation of the best set as a special case."""
    best = posterior.told
    model = posterior.models[best]
    own = [c for c in model.setting.joined if name_of(model.setting, c) == name]
    slopes = [column for candidate in own for column in slopes_of(model, candidate)]
    every = {t.name: t for m in posterior.models.values() for t in m.terms}
    if not slopes:
        return frozenset()
    return frozenset(n for n, t in every.items() if all(holds([t], s) for s in slopes)) - best


def _coincides(posterior: Posterior, name: str, other: str) -> bool:
    """Does another explanation show the same as the one of the best set that it replaces?"""
    best = posterior.told
    rest = (best - {name}) | {other}
    if rest not in posterior.models:
        return False
    model, there = posterior.models[best], posterior.models[rest]
    own = next((c for c in model.setting.joined if name_of(model.setting, c) == name), None)
    rival = next(c for c in there.setting.joined if name_of(there.setting, c) == other)
    return own is not None and coincide(posterior.evidence, model, own, there, rival)


def candidates_of(posterior: Posterior) -> dict[str, Candidate]:
    """All candidates of any set, by their names there."""
    settings = [model.setting for model in posterior.models.values()]
    return {name_of(setting, c): c for setting in settings for c in setting.joined}


def _beside(posterior: Posterior, name: str) -> float:
    """Largest log odds of a set of other members of the best set."""
    rest = posterior.told - {name}
    return max(odds for names, odds in posterior.odds.items() if names <= rest)


def titled_with_module(candidate: Candidate) -> str:
    """A title that names the module once."""
    title, module = candidate.title, candidate.module
    return title if f"{module}." in title else f"{title} in {module}"


def _rivals(posterior: Posterior, name: str) -> Iterator[Rival]:
    """The best alternative to an explanation, and its gain in the same place.

    For a name it is a term without a name, for such a term the best name.
    """
    rest = posterior.told - {name}
    term = "~" in name
    there = {
        names: odds
        for names, odds in posterior.odds.items()
        if name not in names
        and (rest < names if term else names - rest)
        and all(("~" in n) is not term for n in names - rest)
    }
    if there:
        names = max(there, key=lambda n: there[n])
        title = "an unnamed term at the same place"
        if term:
            known = candidates_of(posterior)
            title = " and ".join(sorted(titled_with_module(known[n]) for n in names - rest))
        yield Rival(title, there[names] - _beside(posterior, name))
