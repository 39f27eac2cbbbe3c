"""What can be seen at best: an expected gain in log likelihood, by linear Gaussian algebra."""

from __future__ import annotations

import numpy as np

from .units import Array

FLAT = 1e4
"""Standard deviations that stand for a flat prior."""


def expected_gain(d: Array, sensitivities: Array, flat: Array | None = None) -> float:
    """Expected gain of a model with an effect over one without, both refitted.

    Parameters
    ----------
    d : ndarray, shape (n,); what the effect changes, over the noise of each reading
    sensitivities : ndarray, shape (n, k); change of the readings over their noise by one prior
        standard deviation of each parameter and each sensor's systematic error
    flat : ndarray, shape (n, m), or None; directions that are free, such as another effect of
        unknown size

    Source: own derivation; half of d^T (I + G G^T)^-1 d, by the Woodbury identity.
    """
    columns = [sensitivities]
    if flat is not None and flat.size:
        size = np.maximum(np.linalg.norm(flat, axis=0), 1e-300)
        columns.append(FLAT * np.sqrt(len(d)) * flat / size)
    g = np.concatenate(columns, axis=1)
    inner = np.eye(g.shape[1]) + g.T @ g
    projected = g.T @ d
    gain = 0.5 * (d @ d - projected @ np.linalg.solve(inner, projected))
    return max(float(gain), 0.0)
