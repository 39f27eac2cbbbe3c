"""The most probable set of explanations, refitted to all settled points, and how sure each is."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

from rulec.effects.candidate import TIME, Candidate
from rulec.language.expression import Rejected
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit, variance_inflation_of
from rulec.mismatch.evidence.steady.locate import Suspect, spot_column, suspect_at
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import InitialCandidate, screen
from rulec.mismatch.result import Rival
from rulec.mismatch.search import limits
from rulec.mismatch.search.accepted import Accepted
from rulec.mismatch.search.curve import curve_at
from rulec.mismatch.search.evidence import Term
from rulec.mismatch.search.latent_input import free_course, switched_course
from rulec.mismatch.search.prior import known_of
from rulec.mismatch.search.settled.branches import branches_of
from rulec.mismatch.search.settled.geometry import Geometry
from rulec.mismatch.search.settled.nested import coincide, holds, slopes_of
from rulec.mismatch.search.settled.onset_refinement import with_refined_onset
from rulec.mismatch.search.settled.posterior_curve import curve_of, lost_to, size_of_term
from rulec.mismatch.search.settled.scan import at_points, id_of, name_of
from rulec.mismatch.search.settled.sets import Names, Posterior, Progress, explain
from rulec.mismatch.search.time_varying import varying_parameters


@dataclass(frozen=True)
class Search:
    """What was found: the model fitted to all points, what it says, and all that was weighed."""

    fitted: Fitted
    accepted: tuple[Accepted, ...]
    posterior: Posterior

    @property
    def tried(self) -> int:
        """Sets of explanations that were refitted."""
        return len(self.posterior.models)


def search(rows: Rows, progress: Progress) -> Search:
    """Find the sets of explanations that fit a recording, and tell the most probable one."""
    progress("taking means of operating states")
    posterior = explain(rows, progress)
    progress("refitting the most probable explanation to all settled points")
    model = posterior.models[posterior.told]
    fitted, candidates = _on_all_points(rows, posterior)
    geometry = posterior.settled
    curves = {}
    for term in (t for t in model.terms if t.name in candidates):
        curve = curve_of(geometry, model, term)
        curves[term.name] = replace(
            curve,
            says=term.basis.says,
            branches=branches_of(
                fitted, candidates[term.name], curve, term.basis, size_of_term(model, term)
            ),
            elsewhere=_elsewhere(posterior, geometry, term),
            lost=lost_to(geometry, posterior, term),
        )
    accepted = tuple(
        replace(accepted_of(posterior, name, c), curve=curves.get(name))
        for name, c in candidates.items()
    )
    return Search(fitted, accepted, posterior)


def told_of(posterior: Posterior) -> Names:
    """Members of the best set that are likelier there than not, by any of their names.

    Of several that fit about equally, each may be unlikely, and one of them is there all the same.
    Terms that stay within what laws may be off by are not told.

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


def _on_all_points(rows: Rows, posterior: Posterior) -> tuple[Fitted, dict[str, Candidate]]:
    """The model with terms as courses and curves; candidates by their names in the set."""
    model, told = posterior.models[posterior.told], told_of(posterior)
    was = model.setting
    for candidate in was.joined:
        if name_of(was, candidate) not in told:
            was = was.leaving(candidate.id)
    was = replace(was, known=known_of(model.prior, was))
    fitted = _fitted(rows, at_points(was, rows.system.data.time))
    setting = fitted.setting
    names = {name_of(setting, c): c for c in setting.joined}
    for course in setting.courses:
        fitted = with_refined_onset(fitted, course.unknown)
    for term in (t for t in model.terms if t.name in told):
        there = with_term(fitted, term)
        if there is not None:
            fitted = there
            names[term.name] = fitted.setting.joined[-1]
    return fitted, names


def _fitted(rows: Rows, setting: Configuration) -> Fitted:
    """Fitted twice, the second time with neighbours counted as what they are worth."""
    used = rows.system.data.open
    first = fit(rows, setting, used)
    return fit(rows, first.setting, used, variance_inflation=variance_inflation_of(first))


def with_term(fitted: Fitted, term: Term) -> Fitted | None:
    """A term without a name as a course in time, or as a curve over its driver."""
    spot_id, _, driver = term.name.rpartition("~")
    place = _place(fitted, spot_id)
    if place is None:
        return None
    if term.basis.says:
        there = term.basis.at(fitted.rows.system.data.time)[:, 0] > 0.0
        return _with_trial(fitted, switched_course(fitted, place.spot, there))
    if driver == TIME:
        return _with_trial(fitted, free_course(fitted, place))
    for most in limits.BANDS:
        # Beside another curve its equation may be too long: fewer pieces make a shorter one.
        with contextlib.suppress(Rejected):
            curve = curve_at(fitted, place.spot, driver, most)
            found = screen(fitted, [curve]) if curve is not None else []
            return _with_trial(fitted, found[0]) if found else None
    return None


def _with_trial(fitted: Fitted, trial: InitialCandidate) -> Fitted:
    setting = fitted.setting.joining(trial.candidate, trial.values, trial.fixed, trial.course)
    return _fitted(fitted.rows, setting)


def _place(fitted: Fitted, id_: str) -> Suspect | None:
    """A place, or a parameter of its law, with what an error there explains."""
    spots = fitted.rows.system.builder.spots
    for spot in spots:
        column = spot_column(fitted, spot)
        if spot.id == id_:
            return None if column is None else suspect_at(fitted, spot, column)
    ways = (way for spot in spots for way in varying_parameters(fitted, spot))
    return next((way for way in ways if way.spot.id == id_), None)


def _alike(posterior: Posterior, name: str) -> frozenset[str]:
    """A name with all that say the same: a fault however it came, terms without a name over one
    driver, wherever they are.

    Columns of such terms often coincide, and each would have a part of what all of them have.
    """
    _, mark, driver = name.rpartition("~")
    if not mark:
        return frozenset(n for names in posterior.odds for n in names if id_of(n) == id_of(name))
    if driver == TIME:
        return frozenset({name})
    return frozenset(n for names in posterior.odds for n in names if n.endswith(mark + driver))


def _elsewhere(posterior: Posterior, geometry: Geometry, term: Term) -> tuple[str, ...]:
    """Other places at which a term over the same driver may be, the likeliest first."""
    spots = {s.id: f"{s.module}.{s.place}" for s in geometry.rows.system.builder.spots}
    own = posterior.names
    names = sorted(_alike(posterior, term.name) - {term.name}, key=lambda n: -own[n])
    near = [n.rpartition("~")[0] for n in names if own[n] >= common.MENTIONED]
    return tuple(spots[id_] for id_ in near if id_ in spots)


def accepted_of(posterior: Posterior, name: str, candidate: Candidate) -> Accepted:
    """How sure an explanation of the best set is, and what may be in its place."""
    best, sets = posterior.told, posterior.sets
    alike = _alike(posterior, name)
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
    ranked = [(n, p) for n, p in sorted(others.items(), key=lambda o: -o[1])]
    odds = tuple((known[n], p / own) for n, p in ranked)
    told = sum(p for _, p in odds)
    stands_out = posterior.tolerance.stand_out.get(candidate.id, 1.0)
    same = [n for n, p in ranked if p >= common.REPORTED and _coincides(posterior, name, n)]
    return Accepted(
        candidate,
        _gain(posterior, best, name),
        odds,
        tuple(_rivals(posterior, name)),
        unnamed=max((1.0 - shapeless) / own - 1.0 - told, 0.0),
        shapeless=shapeless / own,
        inexact=limits.INEXACT * (1.0 - stands_out),
        same={known[n].id: {} for n in same},
    )


def _curves_like(posterior: Posterior, name: str) -> frozenset[str]:
    """Terms without a name that hold an explanation of the best set as a special case."""
    best = posterior.told
    model = posterior.models[best]
    own = [c for c in model.setting.joined if name_of(model.setting, c) == name]
    slopes = [column for candidate in own for column in slopes_of(model, candidate)]
    every = {t.name: t for m in posterior.models.values() for t in m.terms}
    if not slopes:
        return frozenset()
    return frozenset(n for n, t in every.items() if all(holds([t], s) for s in slopes)) - best


def _coincides(posterior: Posterior, name: str, other: str) -> bool:
    """Does another explanation, in the place of one of the best set, show as that one does?"""
    best = posterior.told
    rest = (best - {name}) | {other}
    if rest not in posterior.models:
        return False
    model, there = posterior.models[best], posterior.models[rest]
    own = next((c for c in model.setting.joined if name_of(model.setting, c) == name), None)
    rival = next(c for c in there.setting.joined if name_of(there.setting, c) == other)
    return own is not None and coincide(posterior.geometry, model, own, there, rival)


def candidates_of(posterior: Posterior) -> dict[str, Candidate]:
    """All candidates that stand in some set, by their names there."""
    found: dict[str, Candidate] = {}
    for model in posterior.models.values():
        for candidate in model.setting.joined:
            found[name_of(model.setting, candidate)] = candidate
    return found


def _gain(posterior: Posterior, best: Names, name: str) -> float:
    """How much likelier the best set is than what it has beside an explanation, nats."""
    gain = posterior.odds[best] - _beside(posterior, best, name)
    return max(gain, limits.LEAST_GAIN)


def _beside(posterior: Posterior, best: Names, name: str) -> float:
    """Log odds of the best set of what stands beside an explanation."""
    rest = best - {name}
    return max(odds for names, odds in posterior.odds.items() if names <= rest)


def titled_with_module(candidate: Candidate) -> str:
    """A title with its module, once."""
    title, module = candidate.title, candidate.module
    return title if f"{module}." in title else f"{title} in {module}"


def _rivals(posterior: Posterior, name: str) -> Iterator[Rival]:
    """What must lose against an explanation, and what it gains in its place.

    For a name that is a term without one; for such a term, the best name.
    """
    rest = posterior.told - {name}
    beside = _beside(posterior, posterior.told, name)
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
        title = "a term without a name in its place"
        if term:
            known = candidates_of(posterior)
            title = " and ".join(sorted(titled_with_module(known[n]) for n in names - rest))
        yield Rival(title, there[names] - beside)
