"""Screening: faults that cannot fit are not tried.

A fault leaves at least chi-square without the flows that it touches, as if these were unknown where
it is present: no degree, no scaling of their errors and no tolerance of a law leaves less.
"""

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.chi_square import ChiSquare, solved
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, alike, gain_of, in_a_row


def may_fit(test: HypothesisTest, limit: float, tried: np.ndarray | None = None) -> np.ndarray:
    """Faults of the ruleset that may leave no more than this, shape (faults, n), among those to be
    tried, flags of the same shape."""
    shape = (len(test.ruleset.faults), len(test))
    found = np.ones(shape, dtype=bool) if tried is None else tried.copy()
    if test.metric.is_large:
        return found & (least_left(test, found) <= limits.ROUNDED_OTHERWISE * limit)
    for part in test.portions():
        for i, left in _least_left(test.at(part), found[:, part]):
            found[i, part] &= left <= limits.ROUNDED_OTHERWISE * limit
    # The bound excludes no fault that moves the flows of all modules: its direction decides.
    wide = [i for i, f in enumerate(test.ruleset.faults) if not f.module and found[i].any()]
    if wide:
        gain = gain_of(*test.towards(wide))
        found[wide] &= gain >= limits.LIQUID_AT_FIRST * (test.metric.value - limit)
    return found


def _least_left(test: HypothesisTest, tried: np.ndarray) -> list[tuple[int, Array]]:
    """Least chi-square left, shape (n,), per fault that is tried somewhere."""
    found, (points, n) = [], test.members.shape
    flows = np.arange(len(test.flows))[:, None] + np.zeros(n, dtype=int)
    # At one point all flows are few enough to be worked out once for all faults.
    every = test.metric.moving(flows) if points == 1 else None
    for i in np.flatnonzero(tried.any(axis=1)):
        places = [test.places[name] for name in test.touched((test.ruleset.faults[i],))]
        if not places:
            continue
        chi = test.metric.moving(flows[places]) if every is None else every.of(places)
        there = np.repeat(test.present, len(places), axis=0)
        found.append((int(i), _without(chi, there)))
    return found


def least_left(test: HypothesisTest, tried: np.ndarray) -> Array:
    """Least chi-square left by each fault, shape (faults, n), by the few flows that each touches;
    minus infinity where nothing is known."""
    faults = test.ruleset.faults
    places = {
        int(i): [test.places[name] for name in test.touched((faults[i],))]
        for i in np.flatnonzero(tried.any(axis=1))
    }
    least = np.full(tried.shape, -np.inf)
    for chosen, table in alike({i: own for i, own in places.items() if own}):
        which, problem = np.nonzero(tried[chosen])
        size = max(limits.TABLE // (len(table) * len(test.members)) ** 2, 1)
        for low in range(0, len(which), size):
            own, at = table[:, which[low : low + size]], problem[low : low + size]
            chi = test.metric.problems(at).moving(own)
            free = in_a_row(test.present[None, :, at] * (own >= 0)[:, None])
            least[np.array(chosen)[which[low : low + size]], at] = _without(chi, free)
    return least


def _without(chi: ChiSquare, free: Array) -> Array:
    """Chi-square if some of the flows, 1 in a table of shape (flows, n), are free."""
    held = np.eye(len(free))[:, :, None] * (1.0 - free)
    slope = chi.slope * free
    moved = solved(chi.curvature * free[:, None] * free + held, slope[:, None])[:, 0]
    gain = np.einsum("in,in->n", slope, moved)
    # Where these flows are unknown, there is no bound.
    return np.where(np.isfinite(gain), chi.value - gain, -np.inf)


def leading(scores: Array, listed: np.ndarray) -> np.ndarray:
    """The faults with the highest scores, shape (faults, n): some listed ones, by flags of the
    shape (faults,), and as many others, so that neither displace the other."""
    found = np.zeros(scores.shape, dtype=bool)
    for own in (np.flatnonzero(listed), np.flatnonzero(~listed)):
        order = np.argsort(-scores[own], axis=0, kind="stable")[: limits.TRIED_AT_OTHER_TIMES]
        np.put_along_axis(found, own[order], True, axis=0)
    return np.asarray(found & beside_listed(scores, listed, limits.ALIKE))


def beside_listed(scores: Array, listed: np.ndarray, share: float) -> np.ndarray:
    """All listed faults, by flags of the shape (faults,), and others that score at least a share of
    the best of these, shape (faults, n): no others are ever named."""
    best = np.max(scores[listed], axis=0, initial=0.0)
    return np.asarray(listed[:, None] | ((scores > 0.0) & (scores >= share * best)))
