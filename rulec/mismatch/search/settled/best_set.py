"""The most probable set of explanations, refitted to all settled points, and its probabilities."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import TIME, Candidate, DisturbanceLocation
from rulec.language.expression import Rejected
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.model import where_most
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit, variance_inflation_of
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import (
    InitialCandidate,
    Suspect,
    screen,
    spot_column,
    suspect_at,
)
from rulec.mismatch.result import Rival
from rulec.mismatch.search import limits
from rulec.mismatch.search.curve_found import Accepted, CurveFound, RejectedCandidate, branches_of
from rulec.mismatch.search.evidence import Term, known_of
from rulec.mismatch.search.intermittent_fault import with_refined_onset
from rulec.mismatch.search.latent_input import free_course, switched_course, varying_parameters
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry, driver_of
from rulec.mismatch.search.settled.grow_sets import Names, Posterior, Progress, explain, without
from rulec.mismatch.search.settled.nameless import coincide, holds, slopes_of
from rulec.mismatch.search.settled.scan import at_points, id_of, name_of


def curve_of(geometry: Geometry, model: Model, term: Term) -> CurveFound:
    """A term of a model, and the values that single means show beside all else in the model.

    The covariance includes the uncertainty of all other values, errors of form and terms. It takes
    the noise as no smaller than stated: a constant error within the class of a sensor does not show
    in the scatter.
    """
    solution = solved(model)[0]
    covariance = solved(replace(model, weights=model.weights * min(model.scale, 1.0) ** 2))[1]
    own = columns_of(model, term)
    size = size_of_term(model, term)
    driver = driver_of(geometry.rows.system, term.driver)
    read = driver[np.unique(geometry.point)]
    at = np.linspace(float(np.nanmin(read)), float(np.nanmax(read)), limits.CURVE_POINTS)
    there = size * term.basis.at(at)
    weight = np.bincount(geometry.point, term.slopes**2 * model.weights)
    left = model.left + model.table @ solution
    moment = np.bincount(geometry.point, term.slopes * left * model.weights)
    known = np.flatnonzero((weight > 0.0) & np.isfinite(driver[: len(weight)]))
    meant = size * term.basis.at(driver[known]) @ solution[own] - moment[known] / weight[known]
    return CurveFound(
        place=term.changed,
        driver=term.driver,
        at=at,
        value=there @ solution[own],
        covariance=there @ covariance[np.ix_(own, own)] @ there.T,
        means=np.stack([driver[known], meant, weight[known] ** -0.5], axis=1),
    )


def size_of_term(model: Model, term: Term) -> float:
    """Size of the functions of a term in a model, SI of its place."""
    return model.sizes.terms[model.terms.index(term)] / term.norm


def solved(model: Model) -> tuple[Array, Array]:
    """All unknowns of a model less their prior means, shape (unknowns,), and their covariance,
    shape (unknowns, unknowns)."""
    weights, table = model.weights, model.table
    normal = table.T @ (table * weights[:, None]) + model.precision
    unit = np.sqrt(np.diag(normal))
    inverse = np.linalg.inv(normal / np.outer(unit, unit)) / np.outer(unit, unit)
    return -inverse @ (table.T @ (model.left * weights)), inverse


def columns_of(model: Model, term: Term) -> NDArray[np.intp]:
    """Indices of a term's functions among the unknowns of its model: behind values and errors of
    form and of sensors, in the order of `Random`."""
    before = len(model.at) + len(model.forms)
    for other in model.terms[model.terms.index(term) :]:
        before -= other.columns.shape[1]
    return np.arange(before, before + term.columns.shape[1])


def lost_to(geometry: Geometry, posterior: Posterior, term: Term) -> tuple[RejectedCandidate, ...]:
    """Effects that were tried in the place of a term of the best set, by rising loss."""
    best = posterior.told
    rest = best - {term.name}
    model = posterior.models[best]
    groups = np.unique(geometry.group, return_index=True)[1]
    driver = driver_of(geometry.rows.system, term.driver)[geometry.point[groups]]
    found: dict[str, RejectedCandidate] = {}
    for names, other in posterior.models.items():
        new = [c for c in other.setting.joined if rest == without(names, c) != names]
        nats = posterior.odds[best] - posterior.odds[names]
        for candidate in new if len(names) == len(best) else ():
            if candidate.id not in found or nats < found[candidate.id].nats:
                worse = np.maximum(_lost(geometry, other) - _lost(geometry, model), 0.0)
                region = where_most(driver, worse)
                found[candidate.id] = RejectedCandidate(candidate, float(nats), *region)
    return tuple(sorted(found.values(), key=lambda lost: lost.nats))


def _lost(geometry: Geometry, model: Model) -> Array:
    left = model.left + model.table @ solved(model)[0]
    return geometry.lost(left, model.scale)


@dataclass(frozen=True)
class Search:
    """The model fitted to all points, its explanations, all sets that were compared, and all
    nameless terms of the best set, those within the accuracy of laws too."""

    fitted: Fitted
    accepted: tuple[Accepted, ...]
    posterior: Posterior
    curves: tuple[CurveFound, ...]


def search(rows: Rows, progress: Progress) -> Search:
    """Find the sets of explanations that fit a recording, and fit the most probable one."""
    progress("taking means of operating states")
    posterior = explain(rows, progress)
    progress("refitting the most probable explanation to all settled points")
    model = posterior.models[posterior.told]
    fitted, candidates = _on_all_points(rows, posterior)
    geometry = posterior.settled
    drawn = {term.name: curve_of(geometry, model, term) for term in model.terms}
    curves = {}
    for term in (t for t in model.terms if t.name in candidates):
        curve = drawn[term.name]
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
    return Search(fitted, accepted, posterior, tuple({**drawn, **curves}.values()))


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


def _on_all_points(rows: Rows, posterior: Posterior) -> tuple[Fitted, dict[str, Candidate]]:
    """The model with terms as courses and curves; candidates by their names in the set."""
    model, reported = posterior.models[posterior.told], reported_names(posterior)
    setting = model.setting
    for candidate in setting.joined:
        if name_of(setting, candidate) not in reported:
            setting = setting.leaving(candidate.id)
    setting = replace(setting, known=known_of(model.prior, setting))
    fitted = _fitted(rows, at_points(setting, rows.system.data.time))
    for course in fitted.setting.courses:
        fitted = with_refined_onset(fitted, course.unknown)
    fitted = confirmed(fitted)
    names = {name_of(fitted.setting, c): c for c in fitted.setting.joined}
    for term in (t for t in model.terms if t.name in reported):
        there = with_term(fitted, term)
        if there is not None:
            fitted = there
            names[term.name] = fitted.setting.joined[-1]
    return fitted, names


def confirmed(fitted: Fitted) -> Fitted:
    """The model without explanations that vanish where laws are exact, the weakest first: beside
    errors of form an effect may only refine what these leave."""
    while fitted.setting.joined:
        sizes = {c.id: _size(fitted, c) for c in fitted.setting.joined}
        weakest = min(sizes, key=lambda id_: sizes[id_])
        if sizes[weakest] > common.NORMAL_95:
            break
        fitted = _fitted(fitted.rows, fitted.setting.leaving(weakest))
    return fitted


def _size(fitted: Fitted, candidate: Candidate) -> float:
    """Largest amplitude of a candidate, in its standard uncertainty."""
    null = {u.id: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}
    own = [(name, null.get(name.partition("#")[0])) for name in fitted.setting.free_unknowns()]
    values = fitted.setting.values
    sizes = [abs(values[n] - start) / fitted.u(n) for n, start in own if start is not None]
    return max(sizes, default=np.inf)


def _fitted(rows: Rows, setting: Configuration) -> Fitted:
    """Fit twice, the second time with the correlation of neighbours taken into account."""
    used = rows.system.data.open
    first = fit(rows, setting, used)
    return fit(rows, first.setting, used, variance_inflation=variance_inflation_of(first))


def with_term(fitted: Fitted, term: Term) -> Fitted | None:
    """Join a term without a name as a course in time, or as a curve over its driver."""
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
        # Beside another curve its equation may be too long; fewer pieces make it shorter.
        with contextlib.suppress(Rejected):
            curve = _curve_at(fitted, place.spot, driver, most)
            found = screen(fitted, [curve]) if curve is not None else []
            return _with_trial(fitted, found[0]) if found else None
    return None


def _curve_at(fitted: Fitted, spot: DisturbanceLocation, name: str, most: int) -> Candidate | None:
    """A piecewise linear curve of at most `most` pieces over a reading; None where the readings are
    too close together.

    Pieces within the noise of a reading, as at a few operating points, would only sort that noise.

    Source: generalised additive models (Hastie, Tibshirani 1986).
    """
    data = fitted.rows.system.data
    values = data.values[name][data.open]
    least = limits.BAND_WIDTH * float(np.nanmedian(data.noise[name][data.open]))
    for parts in (n for n in limits.BANDS if n <= most):
        knots = np.nanquantile(values, np.linspace(0.0, 1.0, parts + 1))
        if float(np.min(np.diff(knots))) >= least:
            # All pieces together are a constant, which base values may already contain.
            pieces = [i for i in range(parts + 1) if i != parts // 2]
            features = tuple(f"{name}~{i}/{parts}" for i in pieces)
            return fitted.rows.system.builder.free_form(spot.id, features)
    return None


def _with_trial(fitted: Fitted, trial: InitialCandidate) -> Fitted:
    setting = fitted.setting.joining(trial.candidate, trial.values, trial.fixed, trial.course)
    return _fitted(fitted.rows, setting)


def _place(fitted: Fitted, id_: str) -> Suspect | None:
    """A place, or a parameter of the law there, with the error that explains most."""
    spots = fitted.rows.system.builder.spots
    for spot in spots:
        column = spot_column(fitted, spot)
        if spot.id == id_:
            return None if column is None else suspect_at(fitted, spot, column)
    ways = (way for spot in spots for way in varying_parameters(fitted, spot))
    return next((way for way in ways if way.spot.id == id_), None)


def _alike(posterior: Posterior, name: str) -> frozenset[str]:
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


def _elsewhere(posterior: Posterior, geometry: Geometry, term: Term) -> tuple[str, ...]:
    """Other possible places of a term over the same driver, the likeliest first."""
    spots = {s.id: f"{s.module}.{s.place}" for s in geometry.rows.system.builder.spots}
    own = posterior.names
    names = sorted(_alike(posterior, term.name) - {term.name}, key=lambda n: -own[n])
    near = [n.rpartition("~")[0] for n in names if own[n] >= common.MENTIONED]
    return tuple(spots[id_] for id_ in near if id_ in spots)


def accepted_of(posterior: Posterior, name: str, candidate: Candidate) -> Accepted:
    """An explanation of the best set, with the odds of alternatives to it."""
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
    return own is not None and coincide(posterior.geometry, model, own, there, rival)


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
