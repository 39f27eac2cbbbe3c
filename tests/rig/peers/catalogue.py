"""Sparse regression over the catalogue's own terms: which are missing, and by how much.

Sequentially thresholded least squares (Brunton, Proctor, Kutz 2016), the threshold chosen by
cross-validation over blocks of time; none is chosen where that predicts best.
"""

import numpy as np
from numpy.typing import NDArray

from tests.rig.peers import limits
from tests.rig.peers.learnt import evenly
from tests.rig.peers.library import Library
from tests.rig.peers.sparse import Array, weights_of


def chosen(library: Library) -> Array:
    """Weight of each column of a library, shape (columns,)."""
    course = library.course
    rows = evenly(course.learnt, limits.LIBRARY_ROWS)
    return stlsq(library.table[rows], course.residual[rows], course.folds[rows])


def stlsq(table: Array, residual: Array, folds: NDArray[np.intp]) -> Array:
    """Weights, shape (columns,), by a table, shape (n, columns); `folds` are numbers of blocks."""
    norm = np.sqrt(np.mean(table**2, axis=0)) if len(table) else np.ones(table.shape[1])
    norm = np.where(norm > 0, norm, 1.0)
    if len(table) < limits.FEWEST:
        return np.zeros(len(norm))
    return weights_of(table / norm, residual, folds, limits.THRESHOLDS) / norm
