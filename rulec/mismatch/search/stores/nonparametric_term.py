"""A place that follows a state or an input in a way that nobody can name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rulec.effects.candidate import Spot
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.search import limits
from rulec.mismatch.search.stores.beam import Task
from rulec.mismatch.search.stores.price import needed
from rulec.mismatch.search.stores.searcher import Searcher


def or_nameless(searcher: Searcher, named: Fitted, bare: Sequence[Fitted], tried: int) -> Fitted:
    """A free curve at a place, if that says more than all names.

    A curve pays for each of its values, and for being free: where names are right it is behind.
    Several names that come near stand for something that no entry says. `bare` are optima of the
    plain model, the best first: a curve may show beside another of them only.
    """
    plain = bare[0]
    tasks = curves(searcher, bare, searcher.bench.builder.spots)
    drawn = searcher.refined(searcher.ranked(tasks, plain)[: common.DRAWN], plain)
    best = max(drawn, key=lambda f: searcher.gain(f, plain), default=None)
    known = searcher.gain(named, plain)
    enough = needed(len(tasks)) + (limits.SURPASSED * known if known > needed(tried) else 0.0)
    return best if best is not None and searcher.gain(best, plain) > enough else named


def curves(searcher: Searcher, bare: Sequence[Fitted], spots: Sequence[Spot]) -> list[Task]:
    """Free curves over each state and input at some places, each on several plain models."""
    bench = searcher.bench
    assert bench.ruleset.dynamics is not None
    states = (s.id for s in bench.ruleset.dynamics.states)
    drivers = (*states, *bench.balances(()).inputs)[: limits.FOLLOWED]
    pieces = {driver: _pieces(searcher, bare[0], driver) for driver in drivers}
    return [
        (model, (bench.builder.free_form(spot.id, tuple(f"{d}~{i}/{n}" for i in range(n + 1))),))
        for model in bare
        for spot in spots
        if spot.kind in ("balance", "definition")
        for d, n in pieces.items()
        if n > 0
    ]


def _pieces(searcher: Searcher, plain: Fitted, driver: str) -> int:
    """Pieces of a curve over a state or an input; 0 where it stays as it is."""
    course = searcher.bench.trajectory(plain.ids, plain.values, driver, plain.inputs)
    span = float(np.nanmax(course) - np.nanmin(course))
    for count in limits.PIECES:
        knots = np.nanquantile(course, np.linspace(0.0, 1.0, count + 1))
        if span > 0.0 and float(np.min(np.diff(knots))) > limits.PIECE_WIDTH * span:
            return count
    return 0
