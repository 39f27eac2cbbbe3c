"""By how much each further place would raise the expected log Bayes factor of two explanations.

Both foretell all that is read as normal distributions, of which the divergence is that factor.
Written by conditional parts it grows place by place: so of each place only its own small part is
looked at, for all places at once.

Source: Kullback and Leibler 1951; the chain rule of divergences, Cover and Thomas 2006, 2.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from scipy.linalg import solve_triangular

from rulec.mismatch.experiment.foretell import Foretold


@dataclass(frozen=True)
class Conditional:
    """Readings at n places of r rows each, by one explanation, after k readings at some of them.

    `rows`, shape (n, r), are numbers in what is foretold, -1 for a row that says nothing. `by`,
    shape (k, n, r), is the covariance with the readings in units of their own: what is left is the
    covariance before without `by` squared.
    """

    told: Foretold
    explanation: int
    rows: NDArray[np.intp]
    by: Array

    def factors(self, left: NDArray[np.intp]) -> Array:
        """Lower factors of the covariance that is left at some places, shape (places, r, r)."""
        by, rows = self.by[:, left], self.rows[left]
        own = self._between(rows[:, :, None], rows[:, None, :])
        r = np.arange(rows.shape[1])
        own[:, r, r] += rows < 0
        found: Array = np.linalg.cholesky(own - np.einsum("kni,knj->nij", by, by))
        return found

    def with_place(self, place: int, factor: Array) -> Conditional:
        """After readings at one more place, of which `factor` is what was left."""
        n, r = self.rows.shape
        flat = self.rows.ravel()
        known = np.tensordot(self.by[:, place], self.by, axes=(0, 0)).reshape(r, n * r)
        left = self._between(self.rows[place][:, None], flat[None, :]) - known
        more = solve_triangular(factor, left, lower=True).reshape(r, n, r)
        return replace(self, by=np.concatenate([self.by, more]))

    def _between(self, rows: NDArray[np.intp], others: NDArray[np.intp]) -> Array:
        """Covariance before any reading, none of rows that say nothing, broadcast."""
        found = self.told.between(self.explanation, rows, others)
        found *= (rows >= 0) & (others >= 0)
        return found


@dataclass(frozen=True)
class Divergence:
    """Divergence of what one explanation foretells from what another does, after k readings.

    `left` are the places that may be read. `apart`, shape (n, r), are differences of the means,
    `away`, shape (k,), those of the readings so far and `between`, shape (k, k), the factor of
    their covariance, by the other explanation in units of its own.
    """

    true: Conditional
    other: Conditional
    left: NDArray[np.intp]
    apart: Array
    away: Array
    between: Array

    def gains(self) -> Array:
        """What readings at each place that is left would add, nats, shape (left,)."""
        true, other = self.true.factors(self.left), self.other.factors(self.left)
        off, before, own = self._parts(self.left, true, other)
        grown = np.log(_diagonals(other)).sum(axis=1) - np.log(_diagonals(true)).sum(axis=1)
        squares = (off**2).sum(axis=1) + (before**2).sum(axis=(1, 2)) + (own**2).sum(axis=(1, 2))
        gained: Array = grown + 0.5 * (squares - off.shape[1])
        return np.maximum(gained, 0.0)

    def with_place(self, place: int) -> Divergence:
        """After readings at one more place."""
        at = np.array([place])
        true, other = self.true.factors(at), self.other.factors(at)
        off, before, own = (part[0] for part in self._parts(at, true, other))
        upper = np.concatenate([self.between, np.zeros((len(self.between), len(own)))], axis=1)
        return Divergence(
            self.true.with_place(place, true[0]),
            self.other.with_place(place, other[0]),
            self.left[self.left != place],
            self.apart,
            np.concatenate([self.away, off]),
            np.concatenate([upper, np.concatenate([before, own], axis=1)]),
        )

    def _parts(self, at: NDArray[np.intp], true: Array, other: Array) -> tuple[Array, Array, Array]:
        """Of some places: the difference of means that the readings before leave, shape (places,
        r), and the rows of the factor by those readings and by its own, in units of the other."""
        by = np.moveaxis(self.other.by[:, at], 0, 2)
        off = self.apart[at] - by @ self.away
        before = np.moveaxis(self.true.by[:, at], 0, 2) - by @ self.between
        parts = (off[:, :, None], before, true)
        off, before, own = (np.asarray(np.linalg.solve(other, p), dtype=float) for p in parts)
        return off[:, :, 0], before, own


def divergences(told: Foretold, true: int, places: Sequence[int]) -> list[Divergence]:
    """Of what the true explanation foretells from what each does, before any reading.

    `places` are numbered as they come. Where one has fewer rows than others, it gets rows that say
    nothing.
    """
    rows = [np.flatnonzero(told.point == place) for place in places]
    number = np.full((len(places), max((len(own) for own in rows), default=0)), -1)
    for line, own in zip(number, rows, strict=True):
        line[: len(own)] = own
    none, by = number < 0, np.zeros((0, *number.shape))
    every = [Conditional(told, i, number, by) for i in range(len(told.off))]
    left, nothing = np.arange(len(places)), np.zeros((0, 0))
    return [
        Divergence(
            every[true],
            other,
            left,
            np.where(none, 0.0, (told.off[true] - off)[number]),
            np.zeros(0),
            nothing,
        )
        for other, off in zip(every, told.off, strict=True)
    ]


def _diagonals(factors: Array) -> Array:
    return np.diagonal(factors, axis1=1, axis2=2)
