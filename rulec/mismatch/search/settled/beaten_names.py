"""Names that a term without one beat: by how much, and where."""

from __future__ import annotations

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.region import where_most
from rulec.mismatch.search.curve_found import RejectedCandidate
from rulec.mismatch.search.evidence import Term
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry, driver_of
from rulec.mismatch.search.settled.posterior_curve import solved
from rulec.mismatch.search.settled.sets import Posterior, without


def lost_to(geometry: Geometry, posterior: Posterior, term: Term) -> tuple[RejectedCandidate, ...]:
    """Names that were tried in the place of a term of the best set, beside all else that it has;
    the nearest first."""
    best = posterior.told
    rest = best - {term.name}
    model = posterior.models[best]
    found: dict[str, RejectedCandidate] = {}
    for names, other in posterior.models.items():
        new = [c for c in other.setting.joined if rest == without(names, c) != names]
        nats = posterior.odds[best] - posterior.odds[names]
        for candidate in new if len(names) == len(best) else ():
            if candidate.id not in found or nats < found[candidate.id].nats:
                between, share = _where(geometry, model, other, term)
                found[candidate.id] = RejectedCandidate(candidate, float(nats), between, share)
    return tuple(sorted(found.values(), key=lambda lost: lost.nats))


def _where(
    geometry: Geometry, best: Model, other: Model, term: Term
) -> tuple[tuple[float | None, float | None] | None, float]:
    """Between which values of the driver a model loses against the best one."""
    first = np.unique(geometry.group, return_index=True)[1]
    driver = driver_of(geometry.rows.system, term.driver)[geometry.point[first]]
    worse = np.maximum(_lost(geometry, other) - _lost(geometry, best), 0.0)
    return where_most(driver, worse)


def _lost(geometry: Geometry, model: Model) -> Array:
    left = model.left + model.table @ solved(model)[0]
    return geometry.lost(left, model.scale)
