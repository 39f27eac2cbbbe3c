"""The most probable set of explanations of a plant that stores, fitted to convergence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rulec.mismatch.evidence.stores.final_fits import FinalFits, plain_end
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.search.accepted import Accepted
from rulec.mismatch.search.settled.best_set import accepted_of, reported_names
from rulec.mismatch.search.settled.grow_sets import Posterior, Progress
from rulec.mismatch.search.stores.grow_sets import explain


@dataclass(frozen=True)
class Found:
    """The plain model and the one with explanations (possibly the same), both fitted by `ends`; the
    explanations, and all sets that were compared."""

    ends: FinalFits
    plain: Fitted
    best: Fitted
    accepted: tuple[Accepted, ...]
    posterior: Posterior

    @property
    def tried(self) -> int:
        """Sets of explanations that were refitted."""
        return len(self.posterior.models)

    @property
    def nameless(self) -> bool:
        """Is a term without a name among the reported explanations?"""
        posterior = self.posterior
        terms = {term.name for term in posterior.models[posterior.told].terms}
        return bool(terms & reported_names(posterior))

    @property
    def alone(self) -> Mapping[str, float]:
        """Gain of each explanation alone, nats, by its id."""
        odds = self.posterior.odds
        own = {name: odds[names] for names in odds if len(names) == 1 for name in names}
        return {name: gain - odds[frozenset()] for name, gain in own.items()}


def search(bench: SimulationProblem, progress: Progress) -> Found:
    """Find the sets of explanations that fit a recording, and fit the most probable one."""
    posterior = explain(bench, progress)
    progress("fitting the most probable explanation to the end")
    ends, plain = plain_end(bench, posterior.models[frozenset()].setting.values)
    names = reported_names(posterior)
    setting = posterior.models[posterior.told].setting
    for candidate in setting.joined:
        setting = setting if candidate.id in names else setting.leaving(candidate.id)
    best = plain
    if setting.joined:
        best = ends.fitted(setting.joined, {**setting.values, **setting.fixed}, plain)
        best = ends.sharpened(best)
    accepted = tuple(accepted_of(posterior, c.id, c) for c in setting.joined)
    return Found(ends, plain, best, accepted, posterior)
