"""By how much estimates may be off: what is new at every point, and what lasts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.lasting_directions import Directions, Gradients
from rulec_runtime.diagnosis.steady.points import Points


def errors_of(
    ruleset: Ruleset,
    points: Points,
    slopes: Mapping[str, Array],
    flows: Array,
    directions: Directions | None,
) -> tuple[Array, Array, Array, Array, Array]:
    """Covariances, shape (n, observers, observers), of the noise of readings, of all that is new
    at every point and of what stays over a recording, gradients by the latter, shape
    (observers, errors, n), and standard uncertainties by lags alone, shape (observers, n)."""
    # A reading beyond all limits has no slope; its estimate is not used.
    with np.errstate(invalid="ignore"):
        scatter, misfits, lasting, late = gradients_of(ruleset, points, slopes, flows.shape[1])
        left: Gradients = {}
        if directions is not None:
            lasting, left = directions.split(lasting)
        read = _covariance(scatter, flows.shape)
        new = read + _covariance(misfits, flows.shape)
        if left:
            new += _covariance(left, flows.shape)
        stays, gradients = _covariance(lasting, flows.shape), _stacked(lasting, flows.shape)
        return read, new, stays, gradients, np.sqrt(late)


def gradients_of(
    ruleset: Ruleset, points: Points, slopes: Mapping[str, Array], n: int
) -> tuple[Gradients, Gradients, Gradients, Array]:
    """Gradients by the noise of readings, by the observers' own misfits and by what stays over a
    recording, and variances by lags alone, shape (observers, n)."""
    row = ruleset.observer_index
    scatter: Gradients = {}
    misfits: Gradients = {}
    lasting: Gradients = {}
    late = np.zeros((len(row), n))
    with np.errstate(invalid="ignore"):
        for name in slopes:
            _, observer, error = name.split(":", 2)
            if error in ruleset.misfits:
                misfits.setdefault(error, {})[row[observer]] = slopes[name]
                lasting.setdefault(error, {})
                continue
            systematic: Array | float = 1.0
            if error in points.u:
                systematic = points.systematic[error]
                own = slopes[name] * points.statistical(error)
                scatter.setdefault(error, {})[row[observer]] = own
            if error in points.lag:
                own = slopes[name] * points.lag[error]
                lasting.setdefault(f"lag:{error}", {})[row[observer]] = own
                late[row[observer]] += own**2
            lasting.setdefault(error, {})[row[observer]] = slopes[name] * systematic
    return scatter, misfits, lasting, late


def _covariance(gradients: Gradients, shape: tuple[int, int]) -> Array:
    """Sum of the products of gradients by the same error, shape (n, observers, observers).

    An error reaches few observers. Points lie last in memory, so that sums run over them.
    """
    observers, n = shape
    covariance = np.zeros((observers, observers, n))
    for column in gradients.values():
        places = np.array([*column], dtype=int)
        table = np.array([*column.values()]).reshape(-1, n)
        for i, own in zip(places, table, strict=True):
            covariance[i, places] += own * table
    return np.moveaxis(covariance, -1, 0)


def _stacked(gradients: Gradients, shape: tuple[int, int]) -> Array:
    """Gradients by all errors as one table, shape (observers, errors, n)."""
    observers, n = shape
    table = np.zeros((observers, len(gradients), n))
    for place, error in enumerate(sorted(gradients)):
        for i, gradient in gradients[error].items():
            table[i, place] = gradient
    return table
