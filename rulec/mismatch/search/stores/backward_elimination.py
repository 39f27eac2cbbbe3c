"""How sure each explanation is: the model without it, and with others in its place."""

from __future__ import annotations

from collections.abc import Iterator, Set
from dataclasses import replace

import numpy as np

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.evidence.stores.locate import STORED, smooth_gain
from rulec.mismatch.result import Rival
from rulec.mismatch.search import limits
from rulec.mismatch.search.accepted import Accepted
from rulec.mismatch.search.stores.beam import are_twins, in_place_of
from rulec.mismatch.search.stores.price import needed
from rulec.mismatch.search.stores.search import Found
from rulec.mismatch.search.stores.searcher import Searcher


def doubted(searcher: Searcher, found: Found) -> tuple[Fitted, tuple[Accepted, ...]]:
    """Leave out what is not needed, exchange what another explains better, and weigh the rest."""
    best, told = found.best, set[frozenset[str]]()
    while True:
        best, without = _needed_alone(searcher, best, found)
        if not best.joined:
            return best, ()
        told.add(frozenset(best.ids))
        near = {c.id: _near(searcher, best, c, without[c.id], found) for c in best.joined}
        better = [f for own in near.values() for f in own if _ahead(searcher, f, best, told) > 0.0]
        if not better:
            break
        best = max(better, key=lambda f: searcher.gain(f, best))
    accepted = []
    for candidate in best.joined:
        bare = without[candidate.id]
        rivals = tuple(_rivals(searcher, bare, candidate))
        own = searcher.gain(best, bare)
        if max(r.gain for r in rivals) >= own:
            # A course without physics does as well: the rest is weighed without it.
            return doubted(searcher, replace(found, best=bare))
        others = [f for f in near[candidate.id] if not _the_same(f, best)]
        odds = [(f.joined[-1], _odds(_ahead(searcher, f, best, told))) for f in others]
        ranked = tuple(sorted(odds, key=lambda o: -o[1]))
        explained = Accepted(candidate, own, ranked, rivals)
        least = common.REPORTED / explained.probability
        same = {
            f.joined[-1].id: _values_of(f.joined[-1], f)
            for f, (_, probable) in zip(others, odds, strict=True)
            if probable >= least and _coincide(f, best, bare)
        }
        accepted.append(replace(explained, same=same))
    return best, tuple(accepted)


def _ahead(searcher: Searcher, one: Fitted, best: Fitted, told: Set[frozenset[str]]) -> float:
    """Log odds of another model against the one that is told; even at most if told before it."""
    if _as_simple(one, best):
        return 0.0
    odds = searcher.gain(one, best)
    return min(odds, 0.0) if frozenset(one.ids) in told else odds


def _odds(logarithm: float) -> float:
    return float(np.exp(max(logarithm, -700.0)))


def _values_of(candidate: Candidate, fitted: Fitted) -> dict[str, float]:
    return {u.id: fitted.values[u.id] for u in candidate.unknowns}


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


def _near(
    searcher: Searcher, best: Fitted, left: Candidate, bare: Fitted, found: Found
) -> list[Fitted]:
    """Models with another explanation in the place of one that come near the best.

    They are fitted to the end first: a trial does not know yet what errors of sensors do in its
    model.
    """
    others = _others(searcher, found, left, bare)
    near = sorted(others, key=lambda f: -searcher.gain(f, best))[: limits.WEIGHED]
    least = needed(found.tried)
    hopeful = [
        f
        for f in near
        if searcher.gain(f, best) > -limits.DISTANT or searcher.gain(f, bare) > least
    ]
    return [f for f in map(searcher.polished, hopeful) if not f.pressed]


def _as_simple(one: Fitted, other: Fitted) -> bool:
    """Do two models predict the very same with as many values? Then nothing recorded, and no
    habit of what is left out how often, tells which of them it is: their odds are even."""
    values = [sum(not u.fixed for c in f.joined for u in c.unknowns) for f in (one, other)]
    modules = [sum(len(c.modules) for c in f.joined) for f in (one, other)]
    return values[0] == values[1] and modules[0] == modules[1] and are_twins(one, other)


def _coincide(one: Fitted, other: Fitted, bare: Fitted) -> bool:
    """Do two models change what a third one predicts alike, as far as laws have errors of form?"""
    apart = shown = 0.0
    for name, noise in bare.noise.items():
        first, second, before = (f.errors[name] / noise.spread for f in (one, other, bare))
        apart += float(np.nanmean((first - second) ** 2))
        shown += float(np.nanmean((second - before) ** 2))
    return apart < limits.EFFECT_FORM**2 * shown


def _the_same(one: Fitted, other: Fitted) -> bool:
    """Do two models say the same of two places that readings cannot tell apart?

    The same effect that does the very same elsewhere, as what delays the way from one module to the
    next, is no other; a fault elsewhere is, as it is mended there.
    """
    names = [sorted(c.name for c in f.joined) for f in (one, other)]
    fault = one.joined[-1].sort == "fault"
    return names[0] == names[1] and not fault and are_twins(one, other)
