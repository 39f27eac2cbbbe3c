"""Errors of estimates: those new at every point, and those that last.

In a plant with hundreds of estimates, few directions represent the lasting errors. A dozen errors
that only the estimates of one module read act on two or three of them, and nearly in the same way
at all operating points of a recording, so a few directions among them suffice. The rest of an error
counts as new at every point: its variance in full, but not that it lasts.

Source: singular value decomposition (Eckart and Young 1936).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.points import Points

Gradients = dict[str, dict[int, Array]]
"""Per error the observers (places) it reaches: derivative times standard uncertainty, m3/s,
(n,)."""


def errors_of(
    ruleset: Ruleset,
    points: Points,
    slopes: Mapping[str, Array],
    flows: Array,
    directions: Directions | None,
) -> tuple[Array, Array, Array, Array, Array]:
    """Covariances, shape (n, observers, observers), of the noise of readings, of everything new at
    every point and of what lasts over a recording, gradients by the latter, shape (observers,
    errors, n), and standard uncertainties by lags alone, shape (observers, n)."""
    # A reading beyond all limits has no slope; its estimate is unusable.
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
    """Gradients by the noise of readings, by the observers' own misfits and by what lasts over a
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


@dataclass(frozen=True)
class Directions:
    """Per module the errors that only its estimates read, and lasting directions among them,
    orthonormal, shape (errors, directions)."""

    modules: Mapping[str, tuple[tuple[str, ...], Array]]

    def split(self, gradients: Gradients) -> tuple[Gradients, Gradients]:
        """Gradients by directions and by errors shared between modules, and the rest."""
        joined = {error for errors, _ in self.modules.values() for error in errors}
        lasting = {error: own for error, own in gradients.items() if own and error not in joined}
        left: Gradients = {}
        for module, (errors, directions) in self.modules.items():
            places, table = _table(gradients, errors)
            kept = np.einsum("oen,ek->okn", table, directions)
            rest = table - np.einsum("okn,ek->oen", kept, directions)
            for k in range(directions.shape[1]):
                lasting[f"{module}:{k}"] = dict(zip(places, kept[:, k], strict=True))
            for k, error in enumerate(errors):
                left[error] = dict(zip(places, rest[:, k], strict=True))
        return lasting, left


def directions_of(ruleset: Ruleset, gradients: Gradients) -> Directions:
    """Directions that hold nearly all of the variance by gradients at some points."""
    owner = [observer.module for observer in ruleset.observers]
    modules: dict[str, list[str]] = {}
    for error, own in gradients.items():
        readers = {owner[place] for place in own}
        if len(readers) == 1:
            modules.setdefault(readers.pop(), []).append(error)
    return Directions({m: (tuple(own), _directions(gradients, own)) for m, own in modules.items()})


def _directions(gradients: Gradients, errors: list[str]) -> Array:
    _, table = _table(gradients, tuple(errors))
    rows = np.moveaxis(np.nan_to_num(table, posinf=0.0, neginf=0.0), 1, -1).reshape(-1, len(errors))
    _, sizes, directions = np.linalg.svd(rows, full_matrices=False)
    behind = np.append(np.cumsum(sizes[::-1] ** 2)[::-1], 0.0)
    enough = int(np.argmax(behind <= limits.LEFT_OF_ERRORS * behind[0]))
    return np.asarray(directions[:enough].T)


def _table(gradients: Gradients, errors: tuple[str, ...]) -> tuple[list[int], Array]:
    """Observers that some errors reach, and gradients, shape (observers, errors, n)."""
    places = sorted({place for error in errors for place in gradients[error]})
    n = len(next(iter(gradients[errors[0]].values()))) if places else 0
    table = np.zeros((len(places), len(errors), n))
    for k, error in enumerate(errors):
        for place, gradient in gradients[error].items():
            table[places.index(place), k] = gradient
    return places, table
