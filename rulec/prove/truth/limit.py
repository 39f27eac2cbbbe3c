"""What can be seen at best: expected gain in log likelihood of a model that has an effect.

Readings differ from a model without the effect by `d`, in units of their noise. What the model may
change freely hides a part of it: parameters and sensors' errors at the price of their uncertainty,
other unknown effects at none. The rest is what any analysis has to go by. This is the ideal limit:
it takes all noise as white and known, and everything as linear at the truth. Noise with a memory is
made white before; form errors and drifts of known size are among what is changed at a price.

A rival may have any size, and what it changes need not grow in proportion: so it is made as large
as it explains most, in turns.

Source: own derivation from Gaussian conditioning; d^T (I + G G^T)^-1 d by the Woodbury identity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .units import Array

NEGLIGIBLE = 1e-9
"""Share of the largest singular value below which a direction is none."""

TURNS = 4
"""Sizes of a rival that are tried, each by what the last one explained."""

NEAR = 1.05
"""Factor to the size that explains most which is near enough."""

REFINED = 6
"""Rivals whose size is sought: those that come nearest at a moderate one."""


@dataclass(frozen=True)
class Rival:
    """Another effect: `change` gives what it changes at a size from `low` to `high`, over noise,
    shape (n,), or None where it cannot be. `bounded`: a larger size is no explanation."""

    name: str
    low: float
    high: float
    change: Callable[[float], Array | None]
    bounded: bool = False


@dataclass(frozen=True)
class Measure:
    """Products of changes, less what may hide them: a^T (I + G G^T + infinity F F^T)^-1 b.

    Attributes
    ----------
    basis : orthonormal span of F, shape (n, rank)
    free : G beside it, shape (n, k)
    inner : I + G^T G of these, shape (k, k)
    """

    basis: Array
    free: Array
    inner: Array

    @classmethod
    def beside(cls, sensitivities: Array, flat: Array) -> Measure:
        """
        Parameters
        ----------
        sensitivities : G, change over noise per prior standard deviation, shape (n, k), 1
        flat : F, directions that may have any size, shape (n, m), 1; m may be 0
        """
        basis = _span(flat)
        free = sensitivities - basis @ (basis.T @ sensitivities)
        return cls(basis, free, np.eye(free.shape[1]) + free.T @ free)

    def product(self, one: Array, other: Array) -> float:
        """Of two changes, each shape (n,)."""
        left, right = (d - self.basis @ (self.basis.T @ d) for d in (one, other))
        hidden = (self.free.T @ left) @ np.linalg.solve(self.inner, self.free.T @ right)
        return float(left @ right - hidden)

    def gain(self, d: Array) -> float:
        """Expected gain of a model that has a change, shape (n,)."""
        return max(0.5 * self.product(d, d), 0.0)


def expected_gain(d: Array, sensitivities: Array, flat: Array) -> float:
    """Half of d^T (I + G G^T + infinity F F^T)^-1 d; see `Measure`."""
    return Measure.beside(sensitivities, flat).gain(d)


def margin(
    d: Array, sensitivities: Array, flat: Array, rivals: Sequence[Rival]
) -> tuple[float, str]:
    """What is left of the gain beside the best rival, and which rival that is.

    A rival may take any sign; without rivals the margin is infinite. One whose shape may change
    further can come closer than this says.
    """
    measure = Measure.beside(sensitivities, flat)
    moderate = [(*_left(measure, d, r, (r.low * r.high) ** 0.5), r) for r in rivals]
    nearest: dict[str, tuple[float, float, Rival]] = {}
    for found in sorted(moderate, key=lambda m: m[0]):
        nearest.setdefault(found[2].name, found)
    ranked = list(nearest.values())
    sought = [_sought(measure, d, *found) for found in ranked[:REFINED]]
    rest = [(left, rival.name) for left, _, rival in ranked[REFINED:]]
    return min([*sought, *rest], default=(np.inf, ""))


def _sought(
    measure: Measure, d: Array, left: float, wanted: float, rival: Rival
) -> tuple[float, str]:
    """What is left beside a rival that is as large as it explains most."""
    size = (rival.low * rival.high) ** 0.5
    for _ in range(TURNS - 1):
        wanted = min(max(wanted, rival.low), rival.high)
        if size / NEAR < wanted < size * NEAR:
            break
        size = wanted
        tried, wanted = _left(measure, d, rival, size)
        if not np.isfinite(tried):
            break
        left = tried
    return left, rival.name


def _left(measure: Measure, d: Array, rival: Rival, size: float) -> tuple[float, float]:
    """What is left beside a rival in proportion to one of a size, and the size that it asks for."""
    change = rival.change(size)
    if change is None:
        return np.inf, size
    own, common = measure.product(change, change), measure.product(change, d)
    if own <= NEGLIGIBLE * float(change @ change):
        return measure.gain(d), size
    scale = common / own
    if rival.bounded and size * abs(scale) > rival.high:
        scale = float(np.copysign(rival.high / size, scale))
        return max(measure.gain(d) - scale * common + 0.5 * scale**2 * own, 0.0), rival.high
    return max(measure.gain(d) - 0.5 * common**2 / own, 0.0), size * abs(common) / own


def _span(directions: Array) -> Array:
    """Orthonormal basis of what columns span, shape (n, rank); columns are scaled alike first."""
    sizes = np.linalg.norm(directions, axis=0)
    some = directions[:, sizes > 0.0] / sizes[sizes > 0.0]
    if not some.shape[1]:
        return np.zeros((directions.shape[0], 0))
    basis, values, _ = np.linalg.svd(some, full_matrices=False)
    return np.asarray(basis[:, values > NEGLIGIBLE * values[0]])
