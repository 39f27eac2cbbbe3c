"""A term without a name at settled points as a curve: its values, its branches, and what it beat.

Its covariance has the uncertainty of all else in the model; single means show values beside it.
"""

from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import TIME, Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.model import where_most
from rulec.mismatch.evidence.steady.evidence import settled
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.screen import column_at, suspect_at
from rulec.mismatch.evidence.steady.terms import driver_of
from rulec.mismatch.evidence.term import Basis, Switching, Term, ways_there
from rulec.mismatch.search import limits
from rulec.mismatch.search.curve_found import (
    Branches,
    CurveFound,
    RejectedCandidate,
    counted_visits,
    means_of_visits,
)
from rulec.mismatch.search.grow_sets import without
from rulec.mismatch.search.posterior import Posterior, alike_names


def curve_of(posterior: Posterior, term: Term) -> CurveFound:
    """A term of the best set, and the values that single means show beside all else in the model.

    The covariance includes the uncertainty of all other values, errors of form and terms. It takes
    the noise as no smaller than stated: a constant error within the class of a sensor does not show
    in the scatter.
    """
    evidence, model = settled(posterior.evidence), posterior.models[posterior.selected]
    solution = model.solved[0]
    covariance = replace(model, weights=model.weights * min(model.scale, 1.0) ** 2).solved[1]
    own = model.columns_of(term)
    size = model.size_of(term)
    driver = driver_of(evidence.system, term.driver)
    read = driver[np.unique(evidence.point)]
    at = np.linspace(float(np.nanmin(read)), float(np.nanmax(read)), limits.CURVE_POINTS)
    there = size * term.basis.at(at)
    weight = np.bincount(evidence.point, term.slopes**2 * model.weights)
    left = model.left + model.table @ solution
    moment = np.bincount(evidence.point, term.slopes * left * model.weights)
    used = np.flatnonzero((weight > 0.0) & np.isfinite(driver[: len(weight)]))
    meant = size * term.basis.at(driver[used]) @ solution[own] - moment[used] / weight[used]
    return CurveFound(
        location=term.changed,
        driver=term.driver,
        at=at,
        value=there @ solution[own],
        covariance=there @ covariance[np.ix_(own, own)] @ there.T,
        says=term.basis.says,
        means=np.stack([driver[used], meant, weight[used] ** -0.5], axis=1),
    )


def lost_to(posterior: Posterior, term: Term) -> tuple[RejectedCandidate, ...]:
    """Effects that were tried in the place of a term of the best set, by rising loss."""
    evidence, best = settled(posterior.evidence), posterior.selected
    rest = best - {term.name}
    model = posterior.models[best]
    groups = np.unique(evidence.group, return_index=True)[1]
    driver = driver_of(evidence.system, term.driver)[evidence.point[groups]]
    found: dict[str, RejectedCandidate] = {}
    for names, other in posterior.models.items():
        new = [c for c in other.setting.joined if rest == without(names, c) != names]
        nats = posterior.odds[best] - posterior.odds[names]
        for candidate in new if len(names) == len(best) else ():
            if candidate.id not in found or nats < found[candidate.id].nats:
                after, before = (
                    evidence.lost(m.left + m.table @ m.solved[0], m.scale) for m in (other, model)
                )
                region = where_most(driver, np.maximum(after - before, 0.0))
                found[candidate.id] = RejectedCandidate(candidate, float(nats), *region)
    return tuple(sorted(found.values(), key=lambda lost: lost.nats))


def elsewhere(posterior: Posterior, term: Term) -> tuple[str, ...]:
    """Other possible places of a term over the same driver, the likeliest first."""
    every, own = settled(posterior.evidence).system.builder.locations, posterior.names
    by_id = {s.id: f"{s.module}.{s.place}" for s in every}
    names = sorted(alike_names(posterior, term.name) - {term.name}, key=lambda n: -own[n])
    near = [n.rpartition("~")[0] for n in names if own[n] >= common.MENTIONED]
    return tuple(by_id[id_] for id_ in near if id_ in by_id)


def branches_of(
    fitted: Fitted, candidate: Candidate, curve: CurveFound, basis: Basis | Switching, size: float
) -> Branches | None:
    """Gap between the branches of a place over a driver; None without a clock or enough visits.

    Visits count, not samples, as all samples of a visit came the same way. The course that both
    branches share is refitted beside the gap with the prior of `basis` and `size`: a curve found
    without a gap has absorbed part of it. `candidate` is the curve in the fit to all points.
    """
    data, driver = fitted.rows.system.data, curve.driver
    if not data.timed or driver == TIME:
        return None
    bare = fit(fitted.rows, fitted.setting.leaving(candidate.id), fitted.used, 0)
    column = column_at(bare, curve.location)
    if column is None:
        return None
    suspect = suspect_at(bare, curve.location, column)
    z = data.values[driver]
    side, visit = ways_there(z, float(np.nanmedian(data.noise[driver])))
    used = (suspect.weight > 0) & fitted.used & np.isfinite(z) & (side != 0)
    if not used.any():
        return None
    # Where the place hardly shows (a pump behind an open relief valve), its course is meaningless.
    used &= suspect.weight > limits.HARDLY_SHOWN * np.median(suspect.weight[used])
    left, at, way = means_of_visits(visit, used, suspect.weight, suspect.course, z, side)
    counts = counted_visits(at, way)
    if counts is None:
        return None
    gap, u = gap_between(left, way, size * basis.at(at))
    return Branches(gap=gap, u=u, rising=counts[0], falling=counts[1])


def gap_between(left: Array, way: Array, shared: Array) -> tuple[float, float]:
    """Gap between both branches beside a smooth course, and its standard uncertainty.

    `left` and `way` have shape (visits,). `shared`, shape (visits, functions), are functions whose
    amounts have a unit prior. The scatter of the visits is estimated along with them.

    Source: Rasmussen and Williams 2006, 2.7 (a Gaussian process with explicit functions).
    """
    fixed = np.stack([way, np.ones(len(way))], axis=1)
    usual = float(np.std(left)) or 1.0
    best = (-np.inf, 0.0, np.inf)
    for scatter in limits.SCATTERS:
        covariance = shared @ shared.T + (scatter * usual) ** 2 * np.eye(len(left))
        inverse = np.linalg.inv(covariance)
        normal = fixed.T @ inverse @ fixed
        posterior = np.linalg.pinv(normal)
        solution = posterior @ (fixed.T @ inverse @ left)
        rest = left - fixed @ solution
        # Restricted likelihood: two values were fitted.
        score = -0.5 * float(rest @ inverse @ rest + np.linalg.slogdet(covariance)[1])
        score -= 0.5 * float(np.linalg.slogdet(normal)[1])
        if score > best[0]:
            best = (score, 2.0 * float(solution[0]), 2.0 * float(np.sqrt(posterior[0, 0])))
    return best[1], best[2]
