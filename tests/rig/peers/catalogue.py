"""Sparse regression over the catalogue's own terms: which are missing, and by how much.

Sequentially thresholded least squares (Brunton, Proctor, Kutz 2016), the threshold chosen by
cross-validation over blocks of time; none is chosen where that predicts best.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from tests.rig.peers import limits
from tests.rig.peers.learnt import evenly
from tests.rig.peers.library import Library
from tests.rig.peers.limits import FOLDS
from tests.rig.peers.sparse import Array, optimizer_of, rms


def chosen(library: Library) -> Array:
    """Weight of each column of a library, shape (columns,)."""
    course = library.course
    rows = evenly(course.learnt, limits.LIBRARY_ROWS)
    return stlsq(library.table[rows], course.residual[rows], course.folds[rows])


def stlsq(table: Array, residual: Array, folds: NDArray[np.intp]) -> Array:
    """Weights, shape (columns,), by a table, shape (n, columns); `folds` are numbers of blocks."""
    norm = np.sqrt(np.mean(table**2, axis=0)) if len(table) else np.ones(table.shape[1])
    norm, size = np.where(norm > 0, norm, 1.0), rms(residual)
    if len(table) < limits.FEWEST or not size > 0:
        return np.zeros(len(norm))
    x, y = table / norm, residual / size
    squares = [float(np.sum(y**2))]
    for threshold in limits.THRESHOLDS:
        parts = [(folds == k, folds != k) for k in range(FOLDS)]
        wrong = [x[k] @ _weights(x[o], y[o], threshold) - y[k] for k, o in parts]
        squares.append(sum(float(np.sum(w**2)) for w in wrong))
    best = int(np.argmin(squares))
    if not best:
        return np.zeros(len(norm))
    return _weights(x, y, limits.THRESHOLDS[best - 1]) * size / norm


def _weights(x: Array, y: Array, threshold: float) -> Array:
    optimizer = optimizer_of(threshold)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a threshold that drops every term is a result
        optimizer.fit(x, y[:, None])
    weights: Array = np.asarray(optimizer.coef_)[0]
    return weights
