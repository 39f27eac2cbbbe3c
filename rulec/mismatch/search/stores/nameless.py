"""Terms without a name of a plant that stores: a place that follows a driver by any smooth
function."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rulec.mismatch.search.evidence import Term
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.stores.curve_places import Place, drivers_of, place_over, spots_of
from rulec.mismatch.search.stores.geometry import StoresGeometry


def terms(geometry: StoresGeometry, model: Model) -> list[Term]:
    """Terms for each place and each driver, linearised at a model."""
    bench, found = geometry.bench, list[Term]()
    for driver in drivers_of(bench):
        course = geometry.course(model.setting, driver)[bench.record.open]
        for spot in spots_of(bench):
            place = place_over(spot, driver, course)
            if place is not None:
                found += _terms(geometry, model, place)
    return found


def _terms(geometry: StoresGeometry, model: Model, place: Place) -> Iterator[Term]:
    parts, knots = place.parts(geometry.bench.builder)
    setting = model.setting
    for part in parts:
        own = {u.id: knots[u.id] for u in part.unknowns if u.fixed}
        nothing = {u.id: 0.0 for u in part.unknowns if not u.fixed}
        setting = setting.joining(part, nothing, own)
    coefficients = [u.id for part in parts for u in part.unknowns if not u.fixed]
    slopes = geometry.simulated(setting, coefficients)[1] @ place.bends
    for basis in place.bases():
        columns = slopes @ basis.at(place.knots)
        norm = float(np.sqrt(np.mean(columns[:, 0] ** 2)))
        if norm > 0.0 and np.isfinite(columns).all():
            yield Term(
                name=f"{place.spot.id}~{place.driver}",
                spot=place.spot.id,
                changed=place.spot,
                driver=place.driver,
                slopes=np.zeros(0),
                basis=basis,
                norm=norm,
                columns=columns / norm,
            )
