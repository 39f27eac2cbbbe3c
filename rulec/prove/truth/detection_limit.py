"""The limit of detection: expected gain in log likelihood of a model that has an effect.

Readings differ from a model without the effect by `d`, in units of their noise. The model hides a
part of it by changing parameters and sensors' errors, at the price of their uncertainty, and other
unknown effects, at no price. Any analysis can only use the rest. This is the ideal limit: all noise
is white and known, laws are exact, and everything is linear at the truth.

Source: own derivation from Gaussian conditioning; d^T (I + G G^T)^-1 d by the Woodbury identity.
"""

from __future__ import annotations

import numpy as np

from .units import Array

NEGLIGIBLE = 1e-9
"""Share of the largest singular value below which a direction is dropped."""


def expected_gain(d: Array, sensitivities: Array, flat: Array) -> float:
    """Return half of d^T (I + G G^T + infinity F F^T)^-1 d, 1.

    Parameters
    ----------
    d : change of the readings over their noise, shape (n,), 1
    sensitivities : G, change over noise per prior standard deviation, shape (n, k), 1
    flat : F, directions that may have any size, shape (n, m), 1; m may be 0
    """
    sizes = np.linalg.norm(flat, axis=0)
    some, basis = flat[:, sizes > 0.0] / sizes[sizes > 0.0], np.zeros((len(d), 0))
    if some.shape[1]:
        # An orthonormal basis of their span
        basis, values, _ = np.linalg.svd(some, full_matrices=False)
        basis = basis[:, values > NEGLIGIBLE * values[0]]
    free, left = (part - basis @ (basis.T @ part) for part in (sensitivities, d))
    inner, projected = np.eye(free.shape[1]) + free.T @ free, free.T @ left
    return max(0.5 * float(left @ left - projected @ np.linalg.solve(inner, projected)), 0.0)
