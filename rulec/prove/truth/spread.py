"""Priors of form errors and drifts: directions with independent standard normal weights, for the
algebra of the limit of detection."""

from __future__ import annotations

import functools

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from .smooth import Drift, Form, form_error
from .units import Array

DRAWS = 1000
"""Form errors that are drawn to estimate their covariance; variances are known to 5 %."""

NODES = 12
"""Gauss nodes per argument: a polynomial of degree 11 follows one period to 1e-6."""

SLIGHT = 1e-4
"""Size relative to the largest direction below which a direction is left out."""


def form_directions(form: Form, arguments: tuple[Array, ...]) -> Array:
    """Return directions of a law's relative error, for this size and range, shape (n, k).

    Each argument has shape (n,), SI. The sum of squares over k is the variance at a point.
    """
    scaled = [
        2.0 * (a - low) / (high - low) - 1.0
        for a, (low, high) in zip(arguments, form.ranges, strict=True)
    ]
    return np.asarray(form.rms * _basis(scaled) @ _modes(len(scaled)))


def series_of(form: Form) -> Array:
    """Expand a form error of one argument in Legendre polynomials, shape (NODES,)."""
    nodes, weights = leggauss(NODES)
    ((low, high),) = form.ranges
    shares = form(low + 0.5 * (nodes + 1.0) * (high - low))
    return _projected(_basis([nodes]), weights, shares[:, None])[:, 0]


def series_directions(rms: float) -> Array:
    """Return directions of a form error of one argument, as series, shape (NODES, k)."""
    return np.asarray(rms * _modes(1))


def drift_directions(drift: Drift, samples: int) -> Array:
    """Return a sensor's errors in standard deviations, by its first error and its draws.

    Shape (samples, k); a course is linear in them.
    """
    draws = len(drift.draws)
    parts = [
        Drift(drift.extent, unit)(float(first), samples)
        for first, unit in [(1.0, np.zeros(draws)), *((0.0, row) for row in np.eye(draws))]
    ]
    return np.stack(parts, 1)


def _basis(scaled: list[Array]) -> Array:
    """Products of Legendre polynomials, shape (n, NODES ** arguments)."""
    found = np.ones((scaled[0].size, 1))
    for values in scaled:
        one = legvander(values, NODES - 1)
        found = (found[:, :, None] * one[:, None, :]).reshape(scaled[0].size, -1)
    return found


@functools.cache
def _modes(arguments: int) -> Array:
    """Principal directions of form errors with rms 1 over their range, in the basis.

    Source: Karhunen-Loeve expansion from draws; projection by Gauss quadrature.
    """
    nodes, weights = leggauss(NODES)
    axes = np.meshgrid(*[nodes] * arguments, indexing="ij")
    points = [axis.ravel() for axis in axes]
    basis = _basis(points)
    share = functools.reduce(np.multiply.outer, [weights] * arguments).ravel()
    random = np.random.default_rng(arguments)
    unit = ((-1.0, 1.0),) * arguments
    drawn = np.stack([form_error(random, 1.0, unit)(*points) for _ in range(DRAWS)], 1)
    coefficients = _projected(basis, share, drawn)
    left, values, _ = np.linalg.svd(coefficients / np.sqrt(DRAWS), full_matrices=False)
    kept = values > SLIGHT * values[0]
    return np.asarray(left[:, kept] * values[kept])


def _projected(basis: Array, weights: Array, values: Array) -> Array:
    """Coefficients of values at nodes, shape (nodes, k), in an orthogonal basis."""
    sizes = np.sum(weights[:, None] * basis**2, axis=0)
    return np.asarray((basis.T @ (weights[:, None] * values)) / sizes[:, None])
