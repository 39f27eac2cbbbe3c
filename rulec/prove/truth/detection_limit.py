"""The limit of detection: expected gain in log likelihood of a model that has an effect.

Readings differ from a model without the effect by `d`, in units of their noise. The model hides a
part of it by changing parameters and sensors' errors, at the price of their uncertainty, and other
unknown effects, at no price. Any analysis can only use the rest. This is the ideal limit: all noise
is white and known, and everything is linear at the truth. Coloured noise is whitened before; form
errors and drifts of known size are among the priced changes.

A rival may have any size, and its change need not be proportional to its size, so the size that
explains most is found by iteration.

Source: own derivation from Gaussian conditioning; d^T (I + G G^T)^-1 d by the Woodbury identity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .units import Array

NEGLIGIBLE = 1e-9
"""Share of the largest singular value below which a direction is dropped."""

TURNS = 4
"""Sizes of a rival that are tried, each from the fit of the one before."""

NEAR = 1.05
"""Factor to the best size within which the search ends."""

REFINED = 6
"""Rivals whose size is searched: those that are nearest at a moderate size."""


@dataclass(frozen=True)
class Rival:
    """Another effect with a size from `low` to `high`.

    `change` returns its change of the readings over their noise, shape (n,), or None if the plant
    cannot have it. `bounded`: a size above `high` is no explanation.
    """

    name: str
    low: float
    high: float
    change: Callable[[float], Array | None]
    bounded: bool = False


@dataclass(frozen=True)
class Measure:
    """Inner product of changes that accounts for hiding: a^T (I + G G^T + infinity F F^T)^-1 b.

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
        """Return the product of two changes, each of shape (n,)."""
        left, right = (d - self.basis @ (self.basis.T @ d) for d in (one, other))
        hidden = (self.free.T @ left) @ np.linalg.solve(self.inner, self.free.T @ right)
        return float(left @ right - hidden)

    def gain(self, d: Array) -> float:
        """Return the expected gain of a model that has a change, shape (n,)."""
        return max(0.5 * self.product(d, d), 0.0)


def expected_gain(d: Array, sensitivities: Array, flat: Array) -> float:
    """Return half of d^T (I + G G^T + infinity F F^T)^-1 d; see `Measure`."""
    return Measure.beside(sensitivities, flat).gain(d)


def margin(
    d: Array, sensitivities: Array, flat: Array, rivals: Sequence[Rival]
) -> tuple[float, str]:
    """Return the gain over the best rival, and the name of that rival.

    A rival may have either sign; without rivals the margin is infinite. A rival whose shape can
    change further may be closer than this.
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
    """Gain over a rival of the size that explains most, and its name."""
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
    """Gain over a rival in proportion to its change at a size, and the size that this implies."""
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
    """Orthonormal basis of the span of normalised columns, shape (n, rank)."""
    sizes = np.linalg.norm(directions, axis=0)
    some = directions[:, sizes > 0.0] / sizes[sizes > 0.0]
    if not some.shape[1]:
        return np.zeros((directions.shape[0], 0))
    basis, values, _ = np.linalg.svd(some, full_matrices=False)
    return np.asarray(basis[:, values > NEGLIGIBLE * values[0]])
