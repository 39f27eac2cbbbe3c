"""Operating points that cover what may be set, for what no explanation foretells.

Steps that tell explanations apart are as good as those explanations are. What is true may be none
of them, bend elsewhere than where they were fitted, or err less than laws usually do; at operating
points far from each other that shows.

Source: Johnson, Moore and Ylvisaker 1990 (maximin distance designs); Box and Draper 1959 (designs
that guard against a wrong model).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.mismatch.experiment.within import Within


def covering(
    limited: Within, among: NDArray[np.bool_], steps: Sequence[int], most: int, seconds: float
) -> tuple[int, ...]:
    """Up to so many places beside some steps, each the one farthest from all of them, as long as
    there is time, s; the first one in the middle where there is no step.

    `among`, shape (n,), flags places that may be chosen.
    """
    at = _shares(limited)
    left = [place for place in np.flatnonzero(among).tolist() if place not in steps]
    before, found = list(steps), list[int]()
    while left and len(found) < most:
        near = at[before] if before else at.mean(axis=0, keepdims=True)
        far = np.linalg.norm(at[left][:, None] - near[None], axis=2).min(axis=1)
        place = left[int(np.argmax(far) if before else np.argmin(far))]
        if not far.max() > 0.0 or limited.seconds([*found, place]) > seconds:
            break
        left.remove(place)
        found.append(place)
        before.append(place)
    return tuple(found)


def _shares(limited: Within) -> Array:
    """Set points of all places as shares of what may be set, shape (n, inputs); none of an input
    that limits hold where it is."""
    inputs = [limited.places.inputs[name] for name in limited.reach.ranges]
    ends = zip(inputs, limited.reach.ranges.values(), strict=True)
    shares = [(v - low) / (high - low) if high > low else 0.0 * v for v, (low, high) in ends]
    return np.stack(shares, axis=1)
