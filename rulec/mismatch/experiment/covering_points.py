"""Operating points that cover what may be set, for what no explanation foretells.

Steps that tell explanations apart are as good as those explanations are. What is true may be none
of them, bend elsewhere than where they were fitted, or err less than laws usually do. Points that
lie far from each other show that; but with several inputs the farthest ones are corners, where each
input has two values, and two do not tell how a law bends. So points are spread over each input
alone and over all of them together.

Source: Joseph, Gul and Ba 2015 (maximum projection designs); Box and Draper 1959 (designs that
guard against a wrong model).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.mismatch.experiment.limits_of_points import Within


def covering(
    limited: Within, among: NDArray[np.bool_], steps: Sequence[int], most: int, seconds: float
) -> tuple[int, ...]:
    """Up to so many places beside some steps, each the one farthest from all of them by the product
    of distances along each input, as long as there is time, s; the first one in the middle where
    there is no step.

    `among`, shape (n,), flags places that may be chosen.
    """
    at = _shares(limited)
    left = [place for place in np.flatnonzero(among).tolist() if place not in steps]
    found: list[int] = []
    fine = max(most, 1)
    near = np.sum([_near(at, point, fine) for point in at[list(steps)]], axis=0)
    while left and len(found) < most:
        # Before any step all are as good.
        worst = near if steps or found else np.linalg.norm(at - at.mean(axis=0), axis=1)
        place = min(left, key=worst.__getitem__)
        if not np.isfinite(worst[place]) or limited.seconds([*found, place]) > seconds:
            break
        left.remove(place)
        found.append(place)
        near = near + _near(at, at[place], fine)
    return tuple(found)


def _near(at: Array, point: Array, fine: int) -> Array:
    """What one point adds to the criterion at all places, shape (n,): infinite where they coincide.

    Values of an input are as good as apart where `fine` evenly spread ones are.
    """
    apart = np.abs(at - point)
    near: Array = 1.0 / np.prod(apart + 1.0 / fine, axis=1) ** 2
    return np.where(apart.any(axis=1), near, np.inf)


def _shares(limited: Within) -> Array:
    """Set points of all places as shares of what may be set, shape (n, inputs); none of an input
    that limits hold where it is."""
    inputs = [limited.places.inputs[name] for name in limited.reach.ranges]
    ends = zip(inputs, limited.reach.ranges.values(), strict=True)
    shares = [(v - low) / (high - low) if high > low else 0.0 * v for v, (low, high) in ends]
    return np.stack(shares, axis=1)
