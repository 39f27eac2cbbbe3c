"""Where a search for degrees stands, and whether another place is better."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.chi_square import ChiSquare, inverse_information


@dataclass(frozen=True)
class Place:
    """Where the search stands, n problems last.

    Degrees (faults, n), how far they move flows and half the slope of chi-square there, both
    (flows, n), effect of the degrees on the flows (flows, faults, n), chi-square (n,).
    """

    degree: Array
    moved: Array
    slope: Array
    effect: Array
    distance: Array

    def judged_by(self, chi: ChiSquare) -> Place:
        """The same place with another chi-square."""
        distance, slope = chi.at(self.moved)
        return replace(self, slope=slope, distance=finite(distance))

    def is_better(self, other: Place) -> np.ndarray:
        """Whether chi-square is less than at another place, shape (n,).

        The difference of a quadratic between two places is exact in the slopes; a difference of
        values would lose the last steps of the search in rounding.
        """
        gain = np.einsum("in,in->n", self.moved - other.moved, self.slope + other.slope)
        better: np.ndarray = np.isfinite(self.distance) & (gain < 0)
        return better

    def where(self, better: np.ndarray, other: Place) -> Place:
        """Take over the problems where `other` is better."""
        if better.all():
            return other
        return Place(*(np.where(better, b, a) for a, b in self._beside(other)))

    def problems(self, chosen: np.ndarray) -> Place:
        """Some of the problems."""
        return Place(*(own[..., chosen] for own, _ in self._beside(self)))

    def enter(self, chosen: np.ndarray, found: Place) -> None:
        """Write what was found of some of the problems."""
        for own, new in self._beside(found):
            own[..., chosen] = new

    def _beside(self, other: Place) -> list[tuple[Array, Array]]:
        return [(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)]


def newton_step(chi: ChiSquare, place: Place) -> Array:
    """Gauss-Newton change of the degrees, shape (faults, n); 0 where there is none."""
    pull = -np.einsum("idn,in->dn", place.effect, place.slope)
    change = np.einsum("ijn,jn->in", inverse_information(chi.information(place.effect)), pull)
    return np.where(np.isfinite(change).all(axis=0), change, 0.0)


def finite(distance: Array) -> Array:
    """Nothing is farther than what cannot be calculated."""
    return np.where(np.isfinite(distance), distance, np.inf)


def spread_of(information: Array) -> Array:
    """Standard uncertainties of degrees from their information, shape (faults, n)."""
    with np.errstate(invalid="ignore"):
        u: Array = np.sqrt(np.einsum("iin->in", inverse_information(information)))
    return np.where(np.isfinite(u), u, np.inf)


def told_apart(information: Array) -> np.ndarray:
    """Whether the effects of simultaneous faults point in different directions, shape (n,)."""
    own = np.prod(np.einsum("iin->in", information), axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        apart: np.ndarray = (
            np.linalg.det(np.moveaxis(information, -1, 0)) > limits.DEGREES_APART * own
        )
    return apart
