"""Residuals as signed sums of estimates: their values and uncertainties."""

from __future__ import annotations

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset


def signed(ruleset: Ruleset, flows: Array) -> Array:
    """Residuals of flows, m3/s, shape (residuals, n)."""
    row = ruleset.observer_index
    sums = [sum(t.sign * flows[row[t.observer]] for t in r.terms) for r in ruleset.residuals]
    return np.array(sums).reshape(-1, flows.shape[1])


def spreads(ruleset: Ruleset, covariance: Array) -> Array:
    """Standard uncertainties of the residuals, m3/s, shape (residuals, n)."""
    row = ruleset.observer_index
    points_last = np.moveaxis(covariance, 0, -1)
    result = np.zeros((len(ruleset.residuals), len(covariance)))
    for i, residual in enumerate(ruleset.residuals):
        places = [row[t.observer] for t in residual.terms]
        signs = np.array([float(t.sign) for t in residual.terms])
        own = points_last[np.ix_(places, places)]
        variance = np.einsum("i,ijn,j->n", signs, own, signs)
        result[i] = np.sqrt(np.maximum(variance, 0.0))
    return result
