"""A term without a name: its values over its driver, and the effects that it beat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.region import where_most
from rulec.mismatch.search import limits
from rulec.mismatch.search.curve_found import CurveFound, RejectedCandidate
from rulec.mismatch.search.evidence import Term
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry, driver_of
from rulec.mismatch.search.settled.grow_sets import Posterior, without


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
