"""What form errors and drifts may be before anybody has seen them: directions with weights that are
independent and standard normal, for the algebra of what can be seen at best."""

from __future__ import annotations

import functools

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from .smooth import Drift, Form, form_error
from .units import Array

DRAWS = 1000
"""Form errors that are drawn to find how they spread; their variances are known to 5 %."""

NODES = 12
"""Nodes of Gauss per argument: a polynomial of degree 11 follows one period to 1e-6."""

SLIGHT = 1e-4
"""Size over that of the largest direction below which a direction is left out."""


def form_directions(form: Form, arguments: tuple[Array, ...]) -> Array:
    """Shares by which a law with a form error of this size and range may be off, shape (n, k).

    Each argument has shape (n,), SI. The sum of squares over k is the variance at a point.
    """
    scaled = [
        2.0 * (a - low) / (high - low) - 1.0
        for a, (low, high) in zip(arguments, form.ranges, strict=True)
    ]
    return np.asarray(form.rms * _basis(scaled) @ _modes(len(scaled)))


def series_of(form: Form) -> Array:
    """A form error of one argument by Legendre polynomials over its range, shape (NODES,)."""
    nodes, weights = leggauss(NODES)
    ((low, high),) = form.ranges
    shares = form(low + 0.5 * (nodes + 1.0) * (high - low))
    return _projected(_basis([nodes]), weights, shares[:, None])[:, 0]


def series_directions(rms: float) -> Array:
    """Directions of a form error of one argument, as series, shape (NODES, k)."""
    return np.asarray(rms * _modes(1))


def drift_directions(drift: Drift, samples: int) -> Array:
    """Errors of a sensor in standard deviations, shape (samples, k): as first, then by each draw.

    A course is linear in its draws.
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
    """Principal directions of form errors with rms 1 over their range, by the basis.

    Source: Karhunen-Loeve expansion, from draws; projection by quadrature of Gauss.
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
    """Coefficients of values at nodes, shape (nodes, k), by an orthogonal basis."""
    sizes = np.sum(weights[:, None] * basis**2, axis=0)
    return np.asarray((basis.T @ (weights[:, None] * values)) / sizes[:, None])
