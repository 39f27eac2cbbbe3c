"""How sure each explanation is: the model without it, and with others in its place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rulec.effects.candidate import Candidate
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.evidence.stores.locate import STORED, smooth_gain
from rulec.mismatch.result import Rival
from rulec.mismatch.search import limits
from rulec.mismatch.search.accepted import Accepted, Odds
from rulec.mismatch.search.stores.beam import are_twins, in_place_of
from rulec.mismatch.search.stores.price import needed
from rulec.mismatch.search.stores.search import Found
from rulec.mismatch.search.stores.searcher import Searcher


def doubted(searcher: Searcher, found: Found) -> tuple[Fitted, tuple[Accepted, ...]]:
    """Leave out what is not needed, exchange what another explains better, and weigh the rest."""
    best = found.best
    for left in range(limits.EXCHANGES, -1, -1):
        best, without = _needed_alone(searcher, best, found)
        if not best.joined:
            return best, ()
        others = {c.id: _others(searcher, found, c, without[c.id]) for c in best.joined}
        better = _better(searcher, best, [f for own in others.values() for f in own])
        if better is None or not left:
            break
        best = better
    accepted = []
    for candidate in best.joined:
        bare = without[candidate.id]
        rivals = tuple(_rivals(searcher, bare, candidate))
        own = searcher.gain(best, bare)
        if max(r.gain for r in rivals) >= own:
            # A course without physics does as well: the rest is weighed without it.
            return doubted(searcher, replace(found, best=bare))
        accepted.append(
            Accepted(
                candidate, own, _odds(searcher, best, others[candidate.id], bare, found), rivals
            )
        )
    return best, tuple(accepted)


def _others(searcher: Searcher, found: Found, left: Candidate, bare: Fitted) -> list[Fitted]:
    """Other explanations in the place of one, best first; alone they were all tried already."""
    if bare is found.plain and found.singles:
        return [f for f in found.singles if f.ids != (left.id,) and not f.joined[0].members]
    return searcher.ranked(in_place_of(left, bare, searcher.bench.candidates), found.plain)


def _rivals(searcher: Searcher, bare: Fitted, candidate: Candidate) -> Iterator[Rival]:
    """What must lose against it: doing nothing, and as many parameters without physics."""
    yield Rival("the model without it", 0.0)
    count = sum(not u.fixed for u in candidate.unknowns)
    gains = [
        smooth_gain(searcher.bench, bare, searcher.judged, spot, count)
        for spot in searcher.bench.builder.spots
        if spot.kind in STORED and spot.module in candidate.modules
    ]
    if gains:
        yield Rival("a smooth course in time at its place", max(gains))


def _needed_alone(
    searcher: Searcher, best: Fitted, found: Found
) -> tuple[Fitted, dict[str, Fitted]]:
    """A model of which nothing can be left out, and it without each of its explanations."""
    while best.joined:
        without = {c.id: _without(searcher, best, c, found.plain) for c in best.joined}
        worst = min(best.joined, key=lambda c: searcher.gain(best, without[c.id]))
        if searcher.gain(best, without[worst.id]) >= needed(found.tried):
            return best, without
        best = without[worst.id]
    return best, {}


def _without(searcher: Searcher, model: Fitted, left: Candidate, plain: Fitted) -> Fitted:
    """The model without one explanation, fitted anew from here and from the plain model."""
    rest = tuple(c for c in model.joined if c.id != left.id)
    if not rest:
        return plain
    values = {n: v for n, v in model.values.items() if not n.startswith(f"{left.id}.")}
    return searcher.polished(searcher.trial(replace(model, joined=rest, values=values), rest))


def _better(searcher: Searcher, best: Fitted, others: list[Fitted]) -> Fitted | None:
    """A better model with one explanation exchanged for another, if there is one."""
    ahead = max(others, key=lambda f: searcher.gain(f, best), default=None)
    if ahead is None or searcher.gain(ahead, best) < 0.0:
        return None
    polished = searcher.polished(ahead)
    return (
        polished
        if searcher.gain(polished, best) > limits.EXCHANGE_WORTH and not polished.pressed
        else None
    )


def _odds(
    searcher: Searcher, best: Fitted, others: list[Fitted], bare: Fitted, found: Found
) -> Odds:
    """Odds of other explanations in the place of one, the likeliest first.

    Those that come near are fitted to the end first: a trial does not know yet what errors of
    sensors do in its model. The same effect that does the very same elsewhere, as what delays the
    way from one module to the next, is no other; a fault elsewhere is, as it is mended there.
    """
    near = sorted(others, key=lambda f: -searcher.gain(f, best))[: limits.WEIGHED]
    least = needed(found.tried)
    hopeful = [
        f
        for f in near
        if searcher.gain(f, best) > -limits.DISTANT or searcher.gain(f, bare) > least
    ]
    exact = [searcher.polished(f) for f in hopeful]
    ahead = [
        (f.joined[-1], 0.0 if _as_simple(f, best) else searcher.gain(f, best))
        for f in exact
        if not f.pressed and not _the_same(f, best)
    ]
    odds = [(c, float(np.exp(np.clip(g, -700.0, 5.0)))) for c, g in ahead]
    return tuple(sorted(odds, key=lambda o: -o[1]))


def _as_simple(one: Fitted, other: Fitted) -> bool:
    """Do two models predict the very same with as many values? Then nothing recorded, and no
    habit of what is left out how often, tells which of them it is: their odds are even."""
    values = [sum(not u.fixed for c in f.joined for u in c.unknowns) for f in (one, other)]
    modules = [sum(len(c.modules) for c in f.joined) for f in (one, other)]
    return values[0] == values[1] and modules[0] == modules[1] and are_twins(one, other)


def _the_same(one: Fitted, other: Fitted) -> bool:
    """Do two models say the same of two places that readings cannot tell apart?"""
    names = [sorted(c.name for c in f.joined) for f in (one, other)]
    fault = one.joined[-1].sort == "fault"
    return names[0] == names[1] and not fault and are_twins(one, other)
