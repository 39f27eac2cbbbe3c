"""The search by simulation in a plant that stores, and the most probable set fitted to the end."""

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import CurveTerm
from rulec.effects.free_form import curve_through
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.model import where_most
from rulec.mismatch.evidence.stores.evidence import StoresEvidence
from rulec.mismatch.evidence.stores.fit import Fitted, plain_end, refit, sharpened
from rulec.mismatch.evidence.stores.fitted_curve import FittedCurve, fitted_curve
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.evidence.stores.starting_values import from_afar
from rulec.mismatch.search import limits
from rulec.mismatch.search.curve_by_simulation import axis_of, curve_of
from rulec.mismatch.search.curve_found import Accepted, CurveFound, RejectedCandidate
from rulec.mismatch.search.grow_sets import Progress, Search, grow, grow_terms, grown, prune
from rulec.mismatch.search.posterior import Posterior, accepted_of, reported_names, reported_setting
from rulec.mismatch.search.refit import refitted


def explain(problem: SimulationProblem, progress: Progress) -> Posterior:
    """Search for the sets of explanations of a recording."""
    search = begun(problem)
    grown(search, progress, (grow_terms, grow, prune), apart=True)
    progress("refitting the likeliest sets, with errors as they are about the best one")
    # A model that is far off has other errors of form and of sensors.
    evidence = search.evidence
    assert isinstance(evidence, StoresEvidence)
    again = Search(evidence.about(search.models[search.likeliest].setting))
    likely = sorted(search.odds, key=lambda names: -search.odds[names])[: limits.SETS_AGAIN]
    for names in dict.fromkeys((*likely, frozenset())):
        model = search.models[names]
        with contextlib.suppress(np.linalg.LinAlgError):
            again.keep(names, again.refit(model.setting, model, model.terms))
    return again.posterior()


def begun(problem: SimulationProblem) -> Search:
    """A search that has refitted the plain model, with errors linearised at that."""
    first = StoresEvidence(problem)
    near = refitted(first, from_afar(problem, Configuration()))
    search = Search(first.about(near.setting))
    search.keep(frozenset(), search.refit(near.setting, near))
    return search


@dataclass(frozen=True)
class Found:
    """The plain model and the one with explanations (possibly the same), both fitted to the end;
    the explanations, and all sets that were compared."""

    plain: Fitted
    best: Fitted
    accepted: tuple[Accepted, ...]
    posterior: Posterior

    @property
    def has_unnamed(self) -> bool:
        """Is a term without a name among the reported explanations?"""
        posterior = self.posterior
        terms = {term.name for term in posterior.models[posterior.selected].terms}
        return bool(terms & reported_names(posterior))

    @property
    def alone(self) -> Mapping[str, float]:
        """Gain of each explanation alone, nats, by its id."""
        odds = self.posterior.odds
        own = {name: odds[names] for names in odds if len(names) == 1 for name in names}
        return {name: gain - odds[frozenset()] for name, gain in own.items()}


def search(problem: SimulationProblem, progress: Progress) -> Found:
    """Find the sets of explanations that fit a recording, and fit the most probable one."""
    posterior = explain(problem, progress)
    progress("fitting the most probable explanation to the end")
    plain = plain_end(problem, posterior.models[frozenset()].setting.values)
    setting, best = reported_setting(posterior), plain
    if setting.joined:
        values = {**setting.values, **setting.fixed}
        best = sharpened(refit(plain, setting.joined, values))
    accepted = tuple(accepted_of(posterior, c.id, c) for c in setting.joined)
    return Found(plain, best, accepted, posterior)


@dataclass(frozen=True)
class Unnamed:
    """A curve that no entry explains, the share of the squared errors that it explains, and the
    model with it."""

    curve: CurveFound
    share: float
    fitted: Fitted


def likeliest_curve(found: Found) -> Unnamed | None:
    """The curve that gains most beside the plain model, of all terms that were refitted, with the
    places over its driver that fit as well, and the effects that lost to it; None if none is
    likelier than the plain model."""
    posterior = found.posterior
    with_terms = [names for names, model in posterior.models.items() if model.terms]
    if max((posterior.odds[n] for n in with_terms), default=-np.inf) < posterior.odds[frozenset()]:
        return None
    # Terms are linearised at a model that may be far off: only curves show which one is best.
    ways = {t.name: (t.changed, t.driver) for n in with_terms for t in posterior.models[n].terms}
    curves = [fitted_curve(found.plain, *way) for way in ways.values()]
    every = sorted((c for c in curves if c is not None), key=lambda c: -c.gain)
    if not every:
        return None
    first = every[0]
    before, after = (_squares(f) for f in (found.plain, first.fitted))
    least = first.gain + float(np.log(common.MENTIONED))
    driver, own = first.domain.driver, first.domain.location
    near = (c.domain for c in every if c.gain > least)
    locations = (p.location for p in near if p.driver == driver and p.location is not own)
    curve = replace(
        curve_of(first),
        elsewhere=tuple(f"{location.module}.{location.place}" for location in locations),
        lost=_lost(found, first, after),
    )
    share = 1.0 - float(np.sum(after) / max(np.sum(before), 1e-300))
    return Unnamed(curve, max(share, 0.0), first.fitted)


def curves_of(found: Found) -> tuple[CurveTerm, ...]:
    """What the best set has without a name, as far as a module type may hold it: each term drawn
    beside the names and the terms before it."""
    model, curves = found.best, list[CurveTerm]()
    for term in found.posterior.models[found.posterior.selected].terms:
        if not term.changed.may_follow(term.driver):
            continue
        curve = fitted_curve(model, term.changed, term.driver)
        if curve is not None and curve.gain > 0.0:
            model, at = curve.fitted, curve.domain.knots
            curves.append(curve_through(term.changed.id, term.driver, at, curve.value(at)))
    return tuple(curves)


def _squares(fitted: Fitted) -> Array:
    """Squared errors of a model at each sample, over the variance of the reading, shape (n,)."""
    total, measured = np.zeros(len(fitted.problem.time)), fitted.problem.record.measured
    for name, flags in fitted.judged.counted.items():
        spread = float(np.nanstd(measured[name])) or 1.0
        total += np.where(flags, fitted.errors[name] / spread, 0.0) ** 2
    return total


def _lost(found: Found, first: FittedCurve, own: Array) -> tuple[RejectedCandidate, ...]:
    """Effects that were tried alone and gain less than a curve, by rising loss; `own`, shape (n,),
    are the squared errors with the curve."""
    _, axis, shown = axis_of(first)
    driver = np.interp(first.fitted.course(first.domain.driver), axis, shown)
    lost, models, alone = dict[str, RejectedCandidate](), found.posterior.models, found.alone
    every = (models[frozenset({n})].setting for n in sorted(alone, key=lambda n: -alone[n]))
    for setting in [s for s in every if s.joined][: limits.WEIGHED]:
        single = refit(found.plain, setting.joined, {**setting.values, **setting.fixed})
        nats, (candidate,) = float(first.gain - single.gain(found.plain)), single.joined
        before = lost.get(candidate.name)
        if nats > 0.0 and (before is None or nats < before.nats):
            worse = np.maximum(_squares(single) - own, 0.0)
            one = RejectedCandidate(candidate, nats, *where_most(driver, worse))
            lost[candidate.name] = one
    return tuple(sorted(lost.values(), key=lambda one: one.nats))
