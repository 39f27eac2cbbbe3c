"""A fault that is there from the first sample to the last, and too small for any one stretch.

Errors of sensors and of the calibration are the same at all operating points; a fault is not the
same error everywhere. So several operating points together show what the errors hide at each: a
power meter that reads 10 % too much is 9 W off at one speed and 20 W at another, where its bound
allows 10 W that do not change.

Source: own derivation, docs/method.md; the score test of each fault (Rao 1948) over the joint
covariance of all stretches.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.combine import spread_evenly, stacked_covariance
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, Outcome
from rulec_runtime.diagnosis.steady.isolate import Isolation, accepted, quantile, shares
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import residual_basis


def throughout(ruleset: Ruleset, observed: Observed, isolation: Isolation) -> Isolation | None:
    """The verdict of all stretches together, if one fault in all of them explains them best.

    None where they say nothing against a sound plant, where no known fault explains what they say
    (the error of a law's form may look like anything), or where one that begins or ends on the way
    explains it better.
    """
    judged = np.flatnonzero(isolation.judged)
    if len(judged) < 2:
        return None
    test = _stacked(ruleset, observed, judged)
    # Stretches that lack an estimate say nothing of the rest.
    judged = judged[(observed.valid[:, judged] == test.valid[:, None]).all(axis=0)]
    if len(judged) < 2:
        return None
    chance = isolation.chance
    scores = _scores(test)
    if scores.max(initial=0.0) <= quantile(chance / (2 * max(int(np.count_nonzero(scores)), 1))):
        return None
    limit = accepted(test.residuals().size, 1, chance)
    fits = [
        test.run((f,)) if s > 0.0 else None for f, s in zip(ruleset.faults, scores, strict=True)
    ]
    evidence: Array = np.array([_evidence(fit, limit) for fit in fits])
    if not float(evidence.max()) + limits.FAULT_FROM_START > _best_change(test, limit):
        return None
    probability = isolation.probability.copy()
    probability[:, judged] = shares(evidence[:, None])
    degree, u = isolation.degree.copy(), isolation.u.copy()
    for i in np.flatnonzero(np.isfinite(evidence)):
        fit = fits[i]
        assert fit is not None  # it has evidence
        degree[i, judged], u[i, judged] = fit.degree[0, 0], fit.u[0, 0]
    deviating, pair = isolation.deviating.copy(), isolation.pair.copy()
    deviating[judged], pair[judged] = True, -1
    return replace(
        isolation, deviating=deviating, degree=degree, u=u, probability=probability, pair=pair
    )


def _scores(test: HypothesisTest) -> Array:
    """By how many standard uncertainties the degree of each fault is off zero, shape (faults,)."""
    scores = np.zeros(len(test.ruleset.faults))
    for i, fault in enumerate(test.ruleset.faults):
        towards = test.towards(fault)
        if towards is not None and towards[1][0] > 0.0:
            scores[i] = max(towards[0][0], 0.0) / np.sqrt(towards[1][0])
    return scores


def _evidence(fit: Outcome | None, limit: float) -> float:
    """Log-likelihood of a fit; none where it leaves more than chance would."""
    fits = fit is not None and fit.distance[0] <= limit
    return float(fit.evidence[0]) if fit is not None and fits else -np.inf


def _best_change(test: HypothesisTest, limit: float) -> float:
    """The most that a fault explains which begins, or ends, between two of the stretches."""
    assert test.present is not None
    count, best = len(test.present), -float("inf")
    later = (np.arange(count)[:, None] >= np.arange(1, count)).astype(float).T
    for present in (*later, *(1.0 - later)):
        changed = replace(test, present=present)
        for i in np.argsort(-_scores(changed), kind="stable")[: limits.TRIED_AT_OTHER_TIMES]:
            fit = changed.run((test.ruleset.faults[i],))
            best = max(best, _evidence(fit, limit))
    return best


def _stacked(ruleset: Ruleset, observed: Observed, judged: np.ndarray) -> HypothesisTest:
    """One test of stretches spread evenly over a recording, a fault present in all of them."""
    points, valid = spread_evenly(observed, judged)
    basis = residual_basis(ruleset, valid)
    spread = partial(stacked_covariance, observed, valid, basis, points)
    return HypothesisTest(
        ruleset=ruleset,
        observed=observed,
        valid=valid,
        basis=basis,
        members=points,
        spread=spread,
        present=np.ones(len(points)),
    )
