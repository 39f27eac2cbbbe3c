"""What has no name in a plant that stores: the place and the driver whose curve explains most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import TIME

from rulec.effects.candidate import Spot
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.region import where_most
from rulec.mismatch.evidence.stores.ends import Ends
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.search import limits
from rulec.mismatch.search.curve_found import CurveFound, Lost
from rulec.mismatch.search.stores.drawn_curve import Drawn, drawn, place_of, promise
from rulec.mismatch.search.stores.posterior_curve import axis_of, course_of, curve_of
from rulec.mismatch.search.stores.told import Found

Way = tuple[Spot, str]
"""A place and what it may follow."""


@dataclass(frozen=True)
class Unnamed:
    """A curve that no entry has, and the share of the squared errors that goes with it."""

    curve: CurveFound
    share: float


def followed(found: Found) -> Unnamed | None:
    """The place and the driver whose curve explains most beside the plain model, if any does so
    beyond doubt."""
    ends, bench = found.ends, found.ends.bench
    ways = [(spot, driver) for spot in _spots(bench) for driver in _drivers(bench)]
    curves = _drawn(ends, found.plain, ways)
    if not curves or curves[0].gain < needed(len(ways)):
        return None
    return _told(found, curves[0], curves)


def needed(tried: int) -> float:
    """Gain that is worth telling, of so many ways."""
    return limits.NEEDED_OVER_TIME + float(np.log(max(tried, 1)))


def _spots(bench: SimulationProblem) -> list[Spot]:
    """Places at which a law may be off."""
    kinds = ("balance", "definition", "reading")
    return [spot for spot in bench.builder.spots if spot.kind in kinds]


def _drivers(bench: SimulationProblem) -> list[str]:
    """What a place may follow."""
    assert bench.ruleset.dynamics is not None
    states = [s.id for s in bench.ruleset.dynamics.states]
    drivers = [*states, *bench.balances(()).inputs][: limits.FOLLOWED]
    return [*drivers, TIME] if bench.record.timed else drivers


def _drawn(ends: Ends, plain: Fitted, ways: Sequence[Way]) -> list[Drawn]:
    """The curves that promise most, fitted; that with the largest gain first."""

    def promised(way: Way) -> float:
        place = place_of(ends, plain, *way)
        return 0.0 if place is None else promise(ends, plain, place)

    seen = [promised(way) for way in ways]
    order = sorted(range(len(ways)), key=lambda i: -seen[i])
    best = [ways[i] for i in order[: common.DRAWN] if seen[i] > 0.0]
    curves = [drawn(ends, plain, *way) for way in best]
    return sorted((c for c in curves if c is not None), key=lambda c: -c.gain)


def _told(found: Found, first: Drawn, others: Sequence[Drawn]) -> Unnamed:
    """A curve with other places that are not told from its own, and names that lost to it."""
    ends, own = found.ends, first.place
    least = first.gain + float(np.log(common.MENTIONED))
    alike = [
        f"{o.place.spot.module}.{o.place.spot.place}"
        for o in others
        if o.place.spot is not own.spot and o.place.driver == own.driver and o.gain > least
    ]
    curve = replace(curve_of(ends.bench, first), elsewhere=tuple(alike), lost=_lost(found, first))
    before, after = (_squares(ends, f) for f in (found.plain, first.fitted))
    share = 1.0 - float(np.sum(after) / max(np.sum(before), 1e-300))
    return Unnamed(curve, max(share, 0.0))


def _squares(ends: Ends, fitted: Fitted) -> Array:
    """Squared errors of a model at each sample, over the variance of the reading, shape (n,)."""
    total = np.zeros(len(ends.bench.time))
    for name, known in ends.judged.known.items():
        spread = float(np.nanstd(ends.bench.record.measured[name])) or 1.0
        total += np.where(known, fitted.errors[name] / spread, 0.0) ** 2
    return total


def _lost(found: Found, first: Drawn) -> tuple[Lost, ...]:
    """Names that were tried alone and gain less than a curve, each where it gains most; the
    nearest first."""
    ends = found.ends
    driver = axis_of(ends.bench, first).over(course_of(ends.bench, first))
    own = _squares(ends, first.fitted)
    lost = []
    for single in found.singles:
        (candidate,) = single.joined
        nats = first.gain - ends.gain(single, found.plain)
        if nats > 0.0:
            lost.append((nats, candidate, single))
    lost.sort(key=lambda entry: entry[0])
    nearest = {candidate.name: entry for entry in reversed(lost) for candidate in entry[1:2]}
    told = sorted(nearest.values(), key=lambda entry: entry[0])[: limits.WEIGHED]
    return tuple(
        Lost(
            candidate,
            float(nats),
            *where_most(driver, np.maximum(_squares(ends, single) - own, 0.0)),
        )
        for nats, candidate, single in told
    )
