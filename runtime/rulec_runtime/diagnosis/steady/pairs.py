"""Two simultaneous faults, where no single one fits: a sparse non-negative fit.

To first order simultaneous faults add up, so linear effects screen all pairs at once; the best ones
are then fitted in full. Two is the maximum: each further degree reduces the evidence.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.chi_square import Metric
from rulec_runtime.diagnosis.steady.fit import Outcomes, fit
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest


def fit_pairs(test: HypothesisTest, limit: float) -> tuple[list[tuple[int, int]], Outcomes]:
    """Pairs that pass the screening, indexes of faults, and their fits; `limit` is the distance up
    to which one fits, beyond it its log-likelihood is -inf."""
    # At each point, the pairs whose linear effects come closest to the residuals.
    tried, left = _linear(test, test.metric)
    order = np.argsort(left, axis=0)[: limits.PAIRS_SCREENED]
    pairs, faults = [tried[k] for k in np.unique(order)], test.ruleset.faults
    fits = fit(test, [(faults[i], faults[j]) for i, j in pairs])
    evidence = np.where(fits.distance <= limit, fits.evidence, -np.inf)
    return pairs, replace(fits, evidence=evidence)


def _linear(test: HypothesisTest, metric: Metric) -> tuple[list[tuple[int, int]], Array]:
    """Pairs with linear effects and non-negative degrees, and the distance left, shape (pairs,
    n)."""
    slope = test.effects()
    products = (slope.transpose(0, 2, 1) @ (metric.inverse @ slope)).transpose(1, 2, 0)
    pull = -np.einsum("nrf,nr->fn", slope, metric.weighted)
    size = np.einsum("ffn->fn", products)
    seen = np.flatnonzero(slope.any(axis=(0, 1)))
    pairs: list[tuple[int, int]] = []
    found: list[Array] = []
    for place, i in enumerate(seen.tolist()):
        others = seen[place + 1 :]
        cross = products[i, others]
        with np.errstate(divide="ignore", invalid="ignore"):
            determinant = size[i] * size[others] - cross**2
            a = (size[others] * pull[i] - cross * pull[others]) / determinant
            b = (size[i] * pull[others] - cross * pull[i]) / determinant
            left = metric.value - a * pull[i] - b * pull[others]
        # For effects in the same direction the determinant is only rounding, and the fit would
        # reject them: they must not take the place of a distinguishable pair.
        apart = determinant > limits.DEGREES_APART * size[i] * size[others]
        both = apart & (a > 0) & (b > 0) & np.isfinite(left)
        shown = both.any(axis=1)
        pairs += [(i, int(j)) for j in others[shown]]
        found.append(np.where(both, left, np.inf)[shown])
    return pairs, np.concatenate([*found, np.zeros((0, len(test)))])
