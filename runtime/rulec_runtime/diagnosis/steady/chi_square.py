"""Chi-square of the residuals as a function of how far some flows are moved."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady import limits


@dataclass(frozen=True)
class ChiSquare:
    """Chi-square of n problems, quadratic in the flows, as residuals are linear in them.

    A fault touches few flows; the constant contribution of the others is summed up here once.
    Problems are the last axis everywhere, so that numpy loops over them and not over the few
    numbers of one.

    Attributes
    ----------
    value : shape (n,), with no flow moved.
    slope : shape (flows, n), half the derivative by each flow, s/m3.
    curvature : shape (flows, flows, n), half the second derivative, (s/m3)^2.
    """

    value: Array
    slope: Array
    curvature: Array

    def problems(self, chosen: np.ndarray) -> ChiSquare:
        """Some of the problems."""
        return ChiSquare(self.value[chosen], self.slope[:, chosen], self.curvature[..., chosen])

    def at(self, moved: Array) -> tuple[Array, Array]:
        """Value, shape (..., n), and slope, shape of `moved`, with flows moved.

        `moved` has the shape (flows, ..., n), m3/s.
        """
        slope = np.einsum("ijn,j...n->i...n", self.curvature, moved)
        slope += self.slope.reshape(len(slope), *[1] * (moved.ndim - 2), -1)
        value: Array = np.einsum("i...n,i...n->...n", moved, slope)
        value += np.einsum("in,i...n->...n", self.slope, moved) + self.value
        return value, slope

    def information(self, effect: Array) -> Array:
        """Information, (degrees, degrees, n), on degrees with `effect` (flows, degrees, n) on
        flows."""
        weighted = np.einsum("ijn,jdn->idn", self.curvature, effect)
        return np.asarray(np.einsum("ien,idn->edn", effect, weighted))

    def tolerating(self, spread: Array) -> ChiSquare:
        """The same with a covariance, shape (flows, flows, n), added to that of the flows.

        Source: matrix inversion lemma (Woodbury 1950), so that only matrices of the size of the
        touched flows are inverted.
        """
        product = self.curvature.transpose(2, 0, 1) @ spread.transpose(2, 0, 1)
        softened = (np.eye(len(spread)) + product).transpose(1, 2, 0)
        both = solved(softened, np.concatenate([self.curvature, self.slope[:, None]], axis=1))
        slope = both[:, -1]
        taken = np.einsum("in,ijn,jn->n", self.slope, spread, slope)
        return ChiSquare(self.value - taken, slope, both[:, :-1])


@dataclass(frozen=True)
class Metric:
    """Residuals of n problems in the metric of their covariance.

    Attributes
    ----------
    inverse : shape (n, residuals, residuals), inverse covariances, (s/m3)^2.
    weighted : shape (n, residuals), residuals times these, s/m3; those of one point after the
        other.
    value : shape (n,), chi-square as measured.
    basis : shape (rank, flows), residuals of a point as combinations of flows.
    """

    inverse: Array
    weighted: Array
    value: Array
    basis: Array

    def problems(self, chosen: np.ndarray | slice) -> Metric:
        """Some of the problems."""
        tables = self.inverse[chosen], self.weighted[chosen], self.value[chosen]
        return Metric(*tables, self.basis)

    def moving(self, places: Sequence[int]) -> ChiSquare:
        """Chi-square where some flows move, by their rows; those of a problem are these flows of
        one point after the other."""
        rank, (n, size) = len(self.basis), self.weighted.shape
        own, points = self.basis[:, places], size // rank
        moved = points * len(places)
        half = self.inverse.reshape(n, size * points, rank) @ own
        curvature = (own.T @ half.reshape(n, points, rank, moved)).reshape(n, moved, moved)
        slope = (self.weighted.reshape(n, points, rank) @ own).reshape(n, moved)
        columns = np.ascontiguousarray(slope.T), np.ascontiguousarray(curvature.transpose(1, 2, 0))
        return ChiSquare(self.value, *columns)


def metric_of(covariance: Array, residuals: Array, basis: Array) -> Metric:
    """The metric of residuals, shape (n, residuals), m3/s, by their covariance, (m3/s)^2."""
    inverse = inverse_of(covariance)
    weighted = (inverse @ residuals[:, :, None])[:, :, 0]
    return Metric(inverse, weighted, np.einsum("nr,nr->n", residuals, weighted), basis)


def inverse_of(covariance: Array) -> Array:
    """Inverse of each covariance, shape (n, rank, rank).

    A small ridge keeps residuals without an uncertainty of their own solvable; points whose
    covariance is not finite give NaN.
    """
    return _inverse(covariance, limits.RIDGE)


def solved(matrix: Array, right: Array) -> Array:
    """Solutions of small systems, shape of `right` (rows, columns, n); NaN where there is none.

    >>> tables = np.stack([np.ones((2, 2)), 2.0 * np.eye(2)], axis=2)
    >>> solved(tables, np.ones((2, 1, 2)))[:, 0].tolist()
    [[nan, 0.5], [nan, 0.5]]
    """
    if len(matrix) == 1:
        with np.errstate(all="ignore"):
            return right / matrix
    sound = np.asarray(np.isfinite(matrix).all(axis=(0, 1)))
    regular, wanted = _regular(matrix.transpose(2, 0, 1), sound), right.transpose(2, 0, 1)
    solution = np.full(wanted.shape, np.nan)
    try:
        solution[:] = np.linalg.solve(regular, wanted)
    except np.linalg.LinAlgError:  # which one is singular is not said, and may depend on threads
        for own, *of_one in zip(solution, regular, wanted, strict=True):
            with suppress(np.linalg.LinAlgError):
                own[:] = np.linalg.solve(*of_one)
    result = np.ascontiguousarray(solution.transpose(1, 2, 0))
    result[:, :, ~sound] = np.nan
    return result


def _regular(matrices: Array, sound: np.ndarray) -> Array:
    """Matrices, shape (n, rank, rank), with the identity in place of unsound ones."""
    return np.asarray(np.where(sound[:, None, None], matrices, np.eye(matrices.shape[1])))


def inverse_information(information: Array) -> Array:
    """Inverse of each information matrix, shape (degrees, degrees, n); NaN if it has none."""
    if len(information) == 1:
        with np.errstate(divide="ignore", invalid="ignore"):
            return 1.0 / information
    inverse = _inverse(information.transpose(2, 0, 1), limits.RIDGE_OF_INFORMATION)
    return inverse.transpose(1, 2, 0)


def _inverse(matrices: Array, ridge: float) -> Array:
    """Inverse of symmetric matrices, shape (n, rank, rank), with a ridge relative to the trace."""
    rank = matrices.shape[1]
    size = np.einsum("nrr->n", matrices)
    sound = np.isfinite(matrices).all(axis=(1, 2)) & (size > 0)
    least = ridge * np.where(sound, size, 1.0)
    regular = _regular(matrices, sound)
    regular.reshape(len(regular), -1)[:, :: rank + 1] += least[:, None]
    inverse: Array = np.asarray(np.linalg.inv(regular), dtype=float)
    inverse[~sound] = np.nan
    return inverse
