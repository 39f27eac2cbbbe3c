"""Errors of estimates: those new at every point, and those that last."""

from collections.abc import Mapping

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.points import Points

Gradients = dict[str, dict[int, Array]]
"""Per error the observers (places) it reaches: derivative times standard uncertainty, m3/s,
(n,)."""


def errors_of(
    ruleset: Ruleset, points: Points, slopes: Mapping[str, Array], shape: tuple[int, int]
) -> tuple[Array, Array, Array, Array, Array]:
    """Covariances, shape (n, observers, observers), of the noise of readings, of everything new at
    every point and of what lasts over a recording, gradients by the latter, shape (observers,
    errors, n), and standard uncertainties by lags alone, of the `shape` (observers, n)."""
    row = ruleset.observer_index
    scatter: Gradients = {}
    misfits: Gradients = {}
    lasting: Gradients = {}
    late = np.zeros(shape)
    # A reading beyond all limits has no slope; its estimate is unusable.
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
        read = _covariance(scatter, shape)
        new = read + _covariance(misfits, shape)
        return read, new, _covariance(lasting, shape), _stacked(lasting, shape), np.sqrt(late)


def _covariance(gradients: Gradients, shape: tuple[int, int]) -> Array:
    """Sum of the products of gradients by the same error, shape (n, observers, observers).

    An error reaches few observers. Points are last in memory, so that sums run over them.
    """
    observers, n = shape
    covariance = np.zeros((observers, observers, n))
    for column in gradients.values():
        places = np.array([*column], dtype=int)
        table = np.array([*column.values()]).reshape(-1, n)
        # Far outside of its law an estimate has an infinite variance.
        with np.errstate(over="ignore"):
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
