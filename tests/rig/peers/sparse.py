"""A residual over time, and its correction by sparse regression (PySINDy): a law of readings.

Thresholds are chosen by cross-validation over blocks in time.

Source: Brunton, Proctor, Kutz 2016, with sequentially thresholded least squares.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from tests.rig.peers.limits import (
    CHUNKS,
    FEWEST_SAMPLES,
    FOLDS,
    MOST_COLUMNS,
    SPARSE_DEGREE,
    SPARSE_RIDGE,
    SPARSE_ROUNDS,
    SPARSE_THRESHOLDS,
)

Array = NDArray[np.float64]
Columns = Mapping[str, Array]
Predict = Callable[[Array], Array]
F = TypeVar("F", bound=Callable[[Array, Array], Predict])
"""Learn from a table, shape (n, inputs), and residuals of size 1, shape (n,)."""


@dataclass(frozen=True)
class Course:
    """A predicted signal; arrays of shape (n,), NaN where there is no value.

    `heldout` flags samples that may not be used for learning.
    """

    signal: str
    time: Array
    heldout: NDArray[np.bool_]
    measured: Array
    recalibrated: Array

    @property
    def residual(self) -> Array:
        """Measured minus recalibrated."""
        return self.measured - self.recalibrated

    @property
    def learnt(self) -> NDArray[np.bool_]:
        """Training samples."""
        flags: NDArray[np.bool_] = np.isfinite(self.residual) & ~self.heldout
        return flags

    @property
    def folds(self) -> NDArray[np.intp]:
        """Fold of each sample, in successive blocks; -1 for samples that are not used."""
        learnt = self.learnt
        rank = np.cumsum(learnt) - 1
        chunk = rank * CHUNKS // max(int(learnt.sum()), 1)
        return np.where(learnt, chunk % FOLDS, -1)


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def one_thread() -> AbstractContextManager[Any]:
    """Limit numerical libraries to one thread.

    Threads cost more than they save on small matrices, and cases run side by side.
    """
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[Any] = threadpool_limits(1)
    return limits


def mended_by_law(drivers: Columns, course: Course) -> Array:
    """Model the residual as a polynomial of the readings; returns the corrected prediction."""
    folds = course.folds
    learnt = folds >= 0
    if not drivers or learnt.sum() < FEWEST_SAMPLES:
        return course.recalibrated
    columns = standardised(_most_correlated(drivers, course), learnt)
    terms = np.asarray(_library().fit(columns).transform(columns))
    weights = weights_of(terms[learnt], course.residual[learnt], folds[learnt], SPARSE_THRESHOLDS)
    return course.recalibrated + terms @ weights


def weights_of(
    table: Array, residual: Array, folds: NDArray[np.intp], thresholds: Sequence[float]
) -> Array:
    """Weights of the columns of a table, shape (columns,), by the threshold that predicts blocks
    best from the others; none where that is better."""
    size = rms(residual)
    if not size > 0:
        return np.zeros(table.shape[1])

    def fit(threshold: float, x: Array, y: Array) -> Predict:
        weights = _weights(x, y, threshold)
        return lambda table: table @ weights

    target = residual / size
    best = best_of([partial(fit, threshold) for threshold in thresholds], table, target, folds)
    return np.zeros(table.shape[1]) if best is None else size * _weights(table, target, *best.args)


def best_of(fits: Sequence[F], x: Array, y: Array, folds: NDArray[np.intp]) -> F | None:
    """The way of learning that predicts blocks best from the others, None where zero does."""
    squares = [float(np.sum(y**2))]
    parts = [(folds == k, folds != k) for k in range(FOLDS)]
    for fit in fits:
        squares.append(sum(float(np.sum((fit(x[o], y[o])(x[k]) - y[k]) ** 2)) for k, o in parts))
    best = int(np.argmin(squares))
    return fits[best - 1] if best else None


def _weights(x: Array, y: Array, threshold: float) -> Array:
    import pysindy

    optimizer = pysindy.STLSQ(threshold=threshold, alpha=SPARSE_RIDGE, max_iter=SPARSE_ROUNDS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a threshold that drops every term is a result
        optimizer.fit(x, y[:, None])
    weights: Array = np.asarray(optimizer.coef_)[0]
    return weights


def _most_correlated(drivers: Columns, course: Course) -> dict[str, Array]:
    """The columns that correlate best with the residual, as they are or squared."""
    learnt, residual = course.learnt, course.residual

    def alike(values: Array) -> float:
        known = learnt & np.isfinite(values)
        if known.sum() < FEWEST_SAMPLES or np.std(values[known]) == 0:
            return 0.0
        centred = values[known] - values[known].mean()
        with np.errstate(all="ignore"):
            both = [np.corrcoef(v, residual[known])[0, 1] for v in (centred, centred**2)]
        return float(np.nanmax(np.abs(np.nan_to_num(both))))

    order = sorted(drivers, key=lambda header: -alike(drivers[header]))
    return {header: drivers[header] for header in order[:MOST_COLUMNS]}


def standardised(columns: Columns, learnt: NDArray[np.bool_]) -> Array:
    """Standardise by the training samples, clip to their range, fill gaps by their mean.

    Shape (n, columns).
    """
    found = []
    for values in columns.values():
        known = values[learnt & np.isfinite(values)]
        if not len(known):
            found.append(np.zeros(len(values)))
            continue
        scale = float(known.std()) or 1.0
        inside = np.clip(values, known.min(), known.max())
        found.append(np.where(np.isfinite(values), (inside - known.mean()) / scale, 0.0))
    return np.column_stack(found)


def _library() -> Any:
    import pysindy

    return pysindy.PolynomialLibrary(degree=SPARSE_DEGREE)
