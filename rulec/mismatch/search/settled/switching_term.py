"""Terms that switch: by the direction in which an input moved, or where set points change.

An effect that comes and goes exactly with the set points is hardly a fault, which would not depend
on them: it is a law that the model lacks, such as a valve with play, or a change of flow pattern.

Source: Mayergoyz 2003 (a law with memory has branches).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.special import gammaln

from rulec.effects.candidate import TIME, DisturbanceLocation
from rulec.mismatch.evidence.steady.configuration import Course
from rulec.mismatch.evidence.steady.operating_state_means import states_of
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import spot_column
from rulec.mismatch.search.curve_found import ways_there
from rulec.mismatch.search.evidence import Switching, Term
from rulec.mismatch.search.latent_input import varying_parameters
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry, term_of


def by_the_way(
    geometry: Geometry, place: str, changed: DisturbanceLocation, slopes: Array, driver: str
) -> Iterator[Term]:
    """Terms that differ by whether an input rose or fell to its value, if it did both.

    Its direction before the first move is not known: both are tried. `slopes`, shape (open rows,),
    are those of the residuals by `changed`.
    """
    data = geometry.rows.system.data
    side, _ = ways_there(data.values[driver], float(np.nanmedian(data.noise[driver])))
    if not {-1.0, 1.0} <= set(side.tolist()):
        return
    says = f"is not the same after {driver} rose as after it fell: a law with memory, such as play"
    for before in (-1.0, 1.0):
        came = np.where(side == 0.0, before, side)
        ends = np.flatnonzero(np.diff(came) != 0) + 1
        way = Switching(data.time[ends], came[np.append(0, ends)], says, float(np.log(2.0)))
        term = term_of(geometry, place, changed, slopes, TIME, way)
        if term is not None:
            yield term


def with_set_points(
    every: Rows, geometry: Geometry, model: Model, course: Course, place: tuple[str, str]
) -> Iterator[Term]:
    """Terms at a place (module, name) instead of a fault that comes and goes, on or off during each
    visit of an operating state, as most of its points are.

    `every` has all settled points. The price is that of specifying the visits: a fault with few
    ends is cheaper.
    """
    time = every.system.data.time
    new = np.diff(states_of(every.system), prepend=-1) != 0
    visits, begins = np.cumsum(new) - 1, np.flatnonzero(new)
    degree = course.at_times(time).degrees(model.setting.values)
    largest = float(np.max(np.abs(degree), initial=0.0))
    if largest == 0.0:
        return
    here = np.bincount(visits, degree / largest) / np.bincount(visits)
    there = np.round(here)
    ends = np.flatnonzero(np.diff(there) != 0) + 1
    if not len(ends):
        return
    way = Switching(
        time[begins[ends]],
        there[np.append(0, ends)],
        "comes and goes only where set points change, which a fault would not know of",
        price(len(ends), len(begins) - 1),
    )
    for spot in every.system.builder.spots:
        column = spot_column(model.fitted, spot) if (spot.module, spot.place) == place else None
        if column is None:
            continue
        parameters = ((w.spot, w.column) for w in varying_parameters(model.fitted, spot))
        for changed, slopes in [(spot, column), *parameters]:
            term = term_of(geometry, spot.id, changed, slopes[geometry.seen], TIME, way)
            if term is not None:
                yield term


def price(ends: int, borders: int) -> float:
    """Cost of specifying which of some borders are ends, nats."""
    ways = gammaln(borders + 1) - gammaln(ends + 1) - gammaln(borders - ends + 1)
    return float(ways + np.log(borders + 1))
