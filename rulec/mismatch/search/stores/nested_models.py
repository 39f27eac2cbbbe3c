"""Explanations begun where another stands: a fit from afar may not find the way there."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from rulec.effects.candidate import Candidate
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.search import limits
from rulec.mismatch.search.stores.searcher import Searcher


def with_kin(
    searcher: Searcher, models: Sequence[Fitted], candidates: Sequence[Candidate], plain: Fitted
) -> list[Fitted]:
    """Models, and each with one explanation exchanged for its kin, best first.

    A law that holds another as a special case can be no worse than that.
    """
    known = {frozenset(m.ids) for m in models}
    tasks = {
        frozenset((*(i for i in model.ids if i != left.id), kin.id)): (model, left, kin)
        for model in models
        for left in model.joined
        for kin in candidates
        if kin.id not in model.ids and _are_kin(left, kin)
    }
    todo = [task for ids, task in tasks.items() if ids not in known]
    with ThreadPoolExecutor(searcher.workers) as pool:
        found = [f for f in pool.map(lambda t: _exchanged(searcher, *t), todo) if not f.pressed]
    return sorted((*models, *found), key=lambda f: -searcher.standing(f, plain))


def begun_alike(
    searcher: Searcher, refined: Sequence[Fitted], singles: Sequence[Fitted], plain: Fitted
) -> list[Fitted]:
    """Refined models, and faults from where the best of them stands if that is better.

    What begins begins once. Beside other parameters of the plant it may be another time, so these
    are tried both ways: as they were, and as those of the best.
    """
    begun = [f for f in refined if f.joined[0].onset is not None]
    if not begun:
        return list(refined)
    known = {f.ids: f for f in refined}
    best = max(begun, key=lambda f: searcher.gain(f, plain))
    since = best.values[_onset(best)]
    faults = [f for f in singles if f.joined[0].onset is not None and f.ids != best.ids]

    def moved(fault: Fitted) -> Fitted:
        fault = known.get(fault.ids, fault)
        later = replace(fault, values={**fault.values, _onset(fault): since})
        there = _exchanged(searcher, best, best.joined[0], fault.joined[0])
        return max((searcher.polished(later), there), key=lambda f: searcher.gain(f, plain))

    with ThreadPoolExecutor(searcher.workers) as pool:
        for found in pool.map(moved, faults[: limits.ALIGNED]):
            before = known.get(found.ids, plain)
            if not found.pressed and searcher.gain(found, plain) > searcher.gain(before, plain):
                known[found.ids] = found
    return sorted(known.values(), key=lambda f: -searcher.standing(f, plain))


def _exchanged(searcher: Searcher, model: Fitted, left: Candidate, kin: Candidate) -> Fitted:
    """A model with one explanation exchanged, fitted from the values that both have."""
    gone = {u.id for u in left.unknowns}
    shared = {u.name: model.values[u.id] for u in left.unknowns}
    values = {n: v for n, v in model.values.items() if n not in gone}
    values |= {u.id: shared[u.name] for u in kin.unknowns if u.name in shared}
    bare = replace(model, joined=tuple(kin if c is left else c for c in model.joined))
    starts = [{**start, **values} for start in searcher.starts(model, [kin])]
    different = [s for i, s in enumerate(starts) if s not in starts[:i]]
    found = [searcher.polished(replace(bare, values=s)) for s in different]
    return max(found, key=lambda f: searcher.standing(f, model))


def _are_kin(one: Candidate, other: Candidate) -> bool:
    """Do two laws of one place share all values that one of them has, two at least?"""
    names = [{u.name for u in c.unknowns if not u.fixed} for c in (one, other)]
    shared = names[0] & names[1]
    here = (one.module, one.place) == (other.module, other.place)
    return here and shared in names and len(shared) > 1


def _onset(fault: Fitted) -> str:
    """Name of the time at which it begins."""
    onset = fault.joined[0].onset
    assert onset is not None
    return onset.id
