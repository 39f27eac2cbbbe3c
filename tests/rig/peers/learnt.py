"""Peers that learn the residual from the inputs, and name nothing.

Gaussian process (Kennedy and O'Hagan 2001, with maximum likelihood in place of their priors): a
Matern kernel with a length for each input. Neural residual: an ensemble of networks. PySINDy
(Brunton, Proctor, Kutz 2016): a sparse polynomial, as in `sparse`. Inputs count
standardised and within their range in training. Each corrects nothing where that is better over
blocks of the training recording.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tests.rig.peers import limits
from tests.rig.peers.limits import FOLDS
from tests.rig.peers.sparse import Array, Course, Predict, best_of, mended_by_law, rms, standardised

Fit = Callable[[Array, Array], Predict]


def gaussian_process(inputs: Mapping[str, Array], course: Course) -> Array:
    return _learnt(inputs, course, [_process], limits.GP_ROWS)


def neural(inputs: Mapping[str, Array], course: Course) -> Array:
    fits = [lambda x, y, p=p: _ensemble(x, y, p) for p in limits.PENALTIES]
    return _learnt(inputs, course, fits, limits.NETWORK_ROWS)


def sparse(inputs: Mapping[str, Array], course: Course) -> Array:
    return mended_by_law(inputs, course) - course.recalibrated


def evenly(flags: NDArray[np.bool_], most: int) -> NDArray[np.intp]:
    """Numbers of flagged rows, so many at most, evenly spread."""
    rows = np.flatnonzero(flags)
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int))]


def _learnt(inputs: Mapping[str, Array], course: Course, fits: Sequence[Fit], most: int) -> Array:
    """Correction by the way of learning that predicts blocks best from the others, or none."""
    rows = evenly(course.learnt, most)
    size = rms(course.residual[rows])
    if not inputs or len(rows) < FOLDS or not size > 0:
        return np.zeros(len(course.time))
    table = standardised(inputs, course.learnt)
    x, y, folds = table[rows], course.residual[rows] / size, course.folds[rows]
    best = best_of(fits, x, y, folds)
    if best is None:
        return np.zeros(len(table))
    predict = best(x, y)
    # In parts: a kernel between all rows and the learnt ones would take much memory.
    pieces = np.array_split(table, max(len(table) // limits.NETWORK_ROWS, 1))
    return size * np.concatenate([predict(piece) for piece in pieces])


def _process(x: Array, y: Array) -> Predict:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    kernel = ConstantKernel() * Matern(np.ones(x.shape[1]), nu=2.5) + WhiteKernel(0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a length at its bound is an input that does not matter
        predict: Predict = GaussianProcessRegressor(kernel, random_state=0).fit(x, y).predict
    return predict


def _ensemble(x: Array, y: Array, penalty: float) -> Predict:
    from sklearn.neural_network import MLPRegressor

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the last round is taken, settled or not
        members = [
            MLPRegressor(
                hidden_layer_sizes=limits.HIDDEN,
                alpha=penalty,
                early_stopping=True,
                max_iter=500,
                random_state=seed,
            ).fit(x, y)
            for seed in range(limits.MEMBERS)
        ]
    return lambda table: np.mean([member.predict(table) for member in members], axis=0)
