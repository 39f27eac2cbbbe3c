"""A fault present from the first sample to the last, and too small for any single stretch.

Errors of sensors and of the calibration are the same at all operating points; a fault is not. So
several operating points together show a fault that the errors hide at each: a power meter that
reads 10 % too much is 9 W off at one speed and 20 W at another, where its bound allows 10 W that do
not change.

Source: own derivation, docs/method.md; the score test of each fault (Rao 1948) over the joint
covariance of all stretches.
"""

from collections.abc import Sequence

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.contrasts import Contrasts
from rulec_runtime.diagnosis.steady.degree_search import fit
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, gain_of, stacked_test, test_of
from rulec_runtime.diagnosis.steady.isolate import Isolation, accepted, quantile, shares
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import spread_evenly
from rulec_runtime.diagnosis.steady.screen import leading, may_fit


def throughout(ruleset: Ruleset, observed: Observed, isolation: Isolation) -> bool:
    """Whether one fault in all stretches explains them best; then all get the verdict of all
    together.

    Not if they do not contradict a sound plant, if no known fault explains them (the error of a
    law's form may look like anything), or if a fault that begins or ends in between explains them
    better.
    """
    judged = np.flatnonzero(isolation.judged)
    if len(judged) < 2:
        return False
    points, valid = spread_evenly(observed.valid, judged)
    whole = stacked_test(ruleset, observed, valid, points[:, None], np.ones((len(points), 1)))
    # Only stretches with the same usable estimates.
    judged = judged[(observed.valid[:, judged] == valid[:, None]).all(axis=0)]
    if len(judged) < 2:
        return False
    chance = isolation.chance
    # Faults that some stretch names alone are always compared.
    named = np.any(isolation.probability[:, judged] > limits.NAMED_ALONE, axis=1)
    test, own, every = _telling_most(whole, named)
    scores = np.where(ruleset.is_listed, every, 0.0)
    if scores.max(initial=0.0) <= quantile(chance / (2 * max(int(np.count_nonzero(scores)), 1))):
        return False
    limit = accepted(test.freedom, 1, chance)
    tried = may_fit(test, limit, (every[:, None] > 0.0) & own[:, None])
    fits = fit(test, [(fault,) for fault in ruleset.faults], tried)
    evidence = np.where(fits.distance[:, 0] <= limit, fits.evidence[:, 0], -np.inf)
    if (isolation.pair[judged, 0] >= 0).any():
        # Two faults at once explained some stretch better than a change of the liquid.
        evidence[[not fault.module for fault in ruleset.faults]] = -np.inf
    if not np.isfinite(evidence).any():
        return False
    deviating = isolation.deviating[test.members[:, 0]]
    best = float((evidence + ruleset.doubted).max())
    if not best + limits.FAULT_FROM_START > _best_change(test, limit, own, deviating):
        return False
    fitting = np.ix_(np.isfinite(evidence), judged)
    isolation.deviating[judged] = True
    isolation.degree[fitting] = fits.degree[0, np.isfinite(evidence), :1]
    isolation.u[fitting] = fits.u[0, np.isfinite(evidence), :1]
    isolation.probability[:, judged] = shares(evidence[:, None])
    isolation.pair[judged] = -1
    return True


def _telling_most(
    whole: HypothesisTest, named: np.ndarray
) -> tuple[HypothesisTest, np.ndarray, Array]:
    """The test that shows the fault with the largest score, flags of the faults that it shows, and
    the scores, shape (faults,). Faults that move hundreds of flows are included only if `named`, or
    if they have the largest score."""
    every = np.ones(len(whole.ruleset.faults), dtype=bool)
    if len(whole.basis) < limits.MANY_RESIDUALS:
        return whole, every, _scores(whole)[:, 0]
    middle = whole.members[len(whole.members) // 2]
    one = test_of(whole.ruleset, whole.observed, whole.valid, middle)
    scores, best, own = np.zeros(len(every)), whole, every
    for basis, shown in Contrasts(one, len(whole.members)).groups():
        test = whole.in_basis(basis)
        found = _scores(test, shown)[:, 0]
        if found.max() > scores.max():
            best, own = test, np.isin(np.arange(len(every)), shown)
        scores[shown] = found
    # Stacking faults that move hundreds of flows is expensive: only for the best candidate.
    faults = whole.ruleset.faults
    narrow = np.array([len(fault.affects) <= limits.ROWS_OF_A_FAULT for fault in faults])
    return best, own & (narrow | named | (scores >= scores.max())), scores


def _scores(test: HypothesisTest, chosen: Sequence[int] | None = None) -> Array:
    """Degree over its standard uncertainty of each fault, or of some by their places, (faults,
    n)."""
    return np.asarray(np.sqrt(gain_of(*test.towards(chosen))))


def _best_change(
    test: HypothesisTest, limit: float, own: np.ndarray, deviating: np.ndarray
) -> float:
    """The largest evidence of a fault, among those that the test shows, by flags, that begins or
    ends between two of the stretches, or is present where they deviate on their own."""
    count = len(test.members)
    later = (np.arange(count)[:, None] >= np.arange(1, count)).astype(float)
    times = [later, 1.0 - later]
    if deviating.any() and not deviating.all():
        times.append(deviating[:, None].astype(float))
    changed = test.at_other_times(np.hstack(times))
    tried = leading(_scores(changed), test.ruleset.is_listed) & own[:, None]
    tried = may_fit(changed, limit, tried)
    fits = fit(changed, [(fault,) for fault in test.ruleset.faults], tried)
    evidence = fits.evidence + test.ruleset.doubted[:, None]
    return float(np.max(evidence[fits.distance <= limit], initial=-np.inf))
