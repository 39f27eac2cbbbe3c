"""Priors of parameters by the data sheet, in the coordinates of a fit: near 1, without a unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.calibration.limits import NEAR_END
from rulec.knowledge.module_type import Parameter
from rulec.knowledge.parameter_belief import Belief, Coordinates, belief_in
from rulec.limits import BELIEF_FREEDOM


@dataclass(frozen=True, kw_only=True)
class SheetPriors:
    """Priors of n parameters; all arrays have shape (n,).

    Values are those of `coordinates` at points times `size`. `belief` is the prior of the
    parameters at the indices `uncertain`, which have an uncertainty.
    """

    coordinates: Coordinates
    size: Array
    begin: Array
    lowest: Array
    highest: Array
    uncertain: np.ndarray
    belief: Belief

    @classmethod
    def of(cls, stated: Sequence[Parameter]) -> SheetPriors:
        """Priors as type and plant state them; a parameter without uncertainty has none."""
        values, u = np.array([[p.value, p.u] for p in stated]).reshape(-1, 2).T
        positive = np.array([p.positive for p in stated], dtype=bool)
        own = Coordinates(positive)
        plain = np.maximum(np.abs(values), u)
        plain = np.where(plain > 0.0, plain, [p.unit.factor for p in stated])
        size = np.where(positive, 1.0, plain)
        low = np.array([p.lowest for p in stated])
        with np.errstate(divide="ignore"):
            lowest = own.of(np.where(positive, np.maximum(low, 0.0), low)) / size
            highest = own.of(np.array([p.highest for p in stated])) / size
        index = np.flatnonzero(u > 0.0)
        sheet = {p.name: (p.value, p.u) for p in stated if p.u > 0.0}
        return cls(
            coordinates=own,
            size=size,
            begin=own.of(values) / size,
            lowest=lowest,
            highest=highest,
            uncertain=index,
            belief=belief_in(
                tuple(sheet), positive[index], values[index], np.diag(u[index] ** 2), sheet
            ),
        )

    def values(self, at: Array) -> Array:
        """Values at a point, SI."""
        with np.errstate(over="ignore"):
            return self.coordinates.values(at * self.size)

    def nearest(self, values: Array) -> Array:
        """The point of values, SI, shape (n,), moved inside if they are at an end."""
        least = NEAR_END * np.abs(self.values(self.begin))
        inside = np.where(self.coordinates.positive, np.maximum(values, least), values)
        at = self.coordinates.of(inside) / self.size
        return np.clip(at, np.nextafter(self.lowest, np.inf), np.nextafter(self.highest, -np.inf))

    def near(self, at: Array) -> tuple[Array, Array]:
        """Mean, shape (n,), and precision, shape (n, n), of the prior near a point.

        At its centre a Student distribution is sharper than its standard uncertainty. Here the
        latter holds there: what a recording does not determine stays as uncertain as stated.
        """
        size, n = self.size[self.uncertain], len(at)
        prior = self.belief.near(at[self.uncertain] * size)
        mean, precision = at.copy(), np.zeros((n, n))
        mean[self.uncertain] = prior.mean / size
        precision[np.ix_(self.uncertain, self.uncertain)] = (
            prior.precision * np.outer(size, size) * BELIEF_FREEDOM / (BELIEF_FREEDOM + 1.0)
        )
        return mean, precision

    def far(self, at: Array) -> Array:
        """Errors whose squares sum up to the cost of the prior at a point, shape (n,)."""
        mean, precision = self.near(self.begin)
        off = np.sqrt(np.diag(precision)) * (at - mean)
        return np.sign(off) * np.sqrt(BELIEF_FREEDOM * np.log1p(off**2 / BELIEF_FREEDOM))

    def spreads(self, at: Array, covariance: Array) -> Array:
        """Standard uncertainties of values by the covariance of points, shape (n,): the inverse of
        `Coordinates.scales`, so a logarithm gives that of a log-normal value."""
        u = np.sqrt(np.diag(covariance))
        with np.errstate(over="ignore"):  # of values that are no logarithms
            relative = np.sqrt(np.expm1(u**2)) / u
        return np.where(self.coordinates.positive, self.values(at) * relative, self.size)

    def left(self, covariance: Array) -> Array:
        """Standard uncertainties by a covariance, shape (n, n), as shares of those of the sheet."""
        return np.sqrt(np.diag(covariance) * np.diag(self.near(self.begin)[1]))
