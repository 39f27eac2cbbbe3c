"""What can be seen at best: expected gain in log likelihood of a model that has an effect.

Readings differ from a model without the effect by `d`, in units of their noise. What the model may
change freely hides a part of it: parameters and sensors' errors at the price of their uncertainty,
other unknown effects at none. The rest is what any analysis has to go by. This is the ideal limit:
it takes the noise of all samples as independent and known, and everything as linear at the truth.

Source: own derivation from Gaussian conditioning; d^T (I + G G^T)^-1 d by the Woodbury identity.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .units import Array

NEGLIGIBLE = 1e-9
"""Share of the largest singular value below which a direction is none."""


def expected_gain(d: Array, sensitivities: Array, flat: Array) -> float:
    """Half of d^T (I + G G^T + infinity F F^T)^-1 d.

    Parameters
    ----------
    d : noise-free change of all readings by the effect, over their noise, shape (n,), 1
    sensitivities : G, change over noise per prior standard deviation, shape (n, k), 1
    flat : F, directions that may have any size, shape (n, m), 1; m may be 0
    """
    basis = _span(flat)
    left = d - basis @ (basis.T @ d)
    free = sensitivities - basis @ (basis.T @ sensitivities)
    inner = np.eye(free.shape[1]) + free.T @ free
    along = free.T @ left
    return max(0.5 * float(left @ left - along @ np.linalg.solve(inner, along)), 0.0)


def margin(
    d: Array, sensitivities: Array, flat: Array, rivals: Mapping[str, Array]
) -> tuple[float, str]:
    """What is left of the gain beside the best rival, and which rival that is.

    Each rival is the direction, shape (n,), or the directions, shape (n, m), that it may take with
    any size and sign; without rivals the margin is infinite. A rival whose shape may change
    further can come closer than this says.
    """
    best, name = np.inf, ""
    for rival, directions in rivals.items():
        both = np.column_stack([flat, directions])
        if (left := expected_gain(d, sensitivities, both)) < best:
            best, name = left, rival
    return best, name


def _span(directions: Array) -> Array:
    """Orthonormal basis of what columns span, shape (n, rank); columns are scaled alike first."""
    sizes = np.linalg.norm(directions, axis=0)
    some = directions[:, sizes > 0.0] / sizes[sizes > 0.0]
    if not some.shape[1]:
        return np.zeros((directions.shape[0], 0))
    basis, values, _ = np.linalg.svd(some, full_matrices=False)
    return np.asarray(basis[:, values > NEGLIGIBLE * values[0]])
