"""Screening: faults that cannot fit are not tried.

A fault leaves at least chi-square without the flows that it touches, as if these were unknown where
it is present: no degree, no scaling of their errors and no tolerance of a law leaves less.
"""

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.batches import batches
from rulec_runtime.diagnosis.steady.chi_square import ChiSquare, solved
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, gain_of


def may_fit(test: HypothesisTest, limit: float, tried: np.ndarray | None = None) -> np.ndarray:
    """Faults of the ruleset that may leave no more than this, shape (faults, n), among those to be
    tried, flags of the same shape."""
    shape = (len(test.ruleset.faults), len(test))
    found = np.ones(shape, dtype=bool) if tried is None else tried.copy()
    found &= least_left(test, found) <= limits.ROUNDED_OTHERWISE * limit
    # The bound excludes no fault that moves the flows of all modules: its direction decides.
    wide = [i for i, f in enumerate(test.ruleset.faults) if not f.module and found[i].any()]
    if wide:
        gain = gain_of(*test.towards(wide))
        found[wide] &= gain >= limits.LIQUID_AT_FIRST * (test.metric.value - limit)
    return found


def least_left(test: HypothesisTest, tried: np.ndarray) -> Array:
    """Least chi-square left by each fault, shape (faults, n), by the few flows that each touches;
    minus infinity where nothing is known."""
    least = np.full(tried.shape, -np.inf)
    for i in np.flatnonzero(tried.any(axis=1)).tolist():
        rows = [test.rows[name] for name in test.touched((test.ruleset.faults[i],))]
        if not rows:
            continue
        problems = np.flatnonzero(tried[i])
        size = max(limits.TABLE // (len(rows) * len(test.members)) ** 2, 1)
        for at in (problems[part] for part in batches(len(problems), size)):
            free = np.repeat(test.present[:, at], len(rows), axis=0)
            least[i, at] = _without(test.metric.problems(at).moving(rows), free)
    return least


def _without(chi: ChiSquare, free: Array) -> Array:
    """Chi-square if some of the flows, 1 in a table of shape (flows, n), are free."""
    fixed = np.eye(len(free))[:, :, None] * (1.0 - free)
    slope = chi.slope * free
    moved = solved(chi.curvature * free[:, None] * free + fixed, slope[:, None])[:, 0]
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
