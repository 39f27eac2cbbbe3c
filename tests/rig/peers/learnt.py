"""Peers that learn the residual from the inputs, and name nothing.

Gaussian process (Kennedy and O'Hagan 2001, with maximum likelihood in place of their priors): a
Matern kernel with a length for each input. Neural residual: an ensemble of networks. PySINDy
(Brunton, Proctor, Kutz 2016): a sparse polynomial, as in `sparse`. Inputs count
standardised and within their range in training. Each corrects nothing where that is better over
blocks of the training recording.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution
from scipy.stats import false_discovery_control

from tests.rig.peers import limits
from tests.rig.peers.limits import FOLDS

Array = NDArray[np.float64]
Columns = Mapping[str, Array]
Predict = Callable[[Array], Array]
Fit = Callable[[Array, Array], Predict]
F = TypeVar("F", bound=Fit)
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
        chunk = rank * limits.CHUNKS // max(int(learnt.sum()), 1)
        return np.where(learnt, chunk % FOLDS, -1)


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def one_thread() -> AbstractContextManager[Any]:
    """Limit numerical libraries to one thread.

    Threads cost more than they save on small matrices, and cases run side by side.
    """
    from threadpoolctl import threadpool_limits

    one: AbstractContextManager[Any] = threadpool_limits(1)
    return one


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

    how = {"alpha": limits.SPARSE_RIDGE, "max_iter": limits.SPARSE_ROUNDS}
    optimizer = pysindy.STLSQ(threshold=threshold, **how)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a threshold that drops every term is a result
        optimizer.fit(x, y[:, None])
    weights: Array = np.asarray(optimizer.coef_)[0]
    return weights


def _most_correlated(drivers: Columns, course: Course) -> dict[str, Array]:
    """The columns that correlate best with the residual, as they are or squared."""
    learnt, residual = course.learnt, course.residual

    def alike(values: Array) -> float:
        finite = learnt & np.isfinite(values)
        if finite.sum() < limits.FEWEST_SAMPLES or np.std(values[finite]) == 0:
            return 0.0
        centred = values[finite] - values[finite].mean()
        with np.errstate(all="ignore"):
            both = [np.corrcoef(v, residual[finite])[0, 1] for v in (centred, centred**2)]
        return float(np.nanmax(np.abs(np.nan_to_num(both))))

    order = sorted(drivers, key=lambda header: -alike(drivers[header]))
    return {header: drivers[header] for header in order[: limits.MOST_COLUMNS]}


def standardised(columns: Columns, learnt: NDArray[np.bool_]) -> Array:
    """Standardise by the training samples, clip to their range, fill gaps by their mean.

    Shape (n, columns).
    """
    found = []
    for values in columns.values():
        finite = values[learnt & np.isfinite(values)]
        if not len(finite):
            found.append(np.zeros(len(values)))
            continue
        scale = float(finite.std()) or 1.0
        inside = np.clip(values, finite.min(), finite.max())
        found.append(np.where(np.isfinite(values), (inside - finite.mean()) / scale, 0.0))
    return np.column_stack(found)


def gaussian_process(inputs: Mapping[str, Array], course: Course) -> Array:
    return _learnt(inputs, course, [_process], limits.GP_ROWS)


def neural(inputs: Mapping[str, Array], course: Course) -> Array:
    fits = [lambda x, y, p=p: _ensemble(x, y, p) for p in limits.PENALTIES]
    return _learnt(inputs, course, fits, limits.NETWORK_ROWS)


def sparse(inputs: Mapping[str, Array], course: Course) -> Array:
    """Model the residual as a polynomial of the inputs."""
    import pysindy

    folds = course.folds
    learnt = folds >= 0
    if not inputs or learnt.sum() < limits.FEWEST_SAMPLES:
        return np.zeros(len(course.time))
    columns = standardised(_most_correlated(inputs, course), learnt)
    library = pysindy.PolynomialLibrary(degree=limits.SPARSE_DEGREE)
    terms = np.asarray(library.fit(columns).transform(columns))
    parts = terms[learnt], course.residual[learnt], folds[learnt]
    return terms @ weights_of(*parts, limits.SPARSE_THRESHOLDS)


def evenly(flags: NDArray[np.bool_], most: int) -> NDArray[np.intp]:
    """Numbers of flagged rows, so many at most, evenly spread."""
    rows = np.flatnonzero(flags)
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int))]


def _learnt(
    inputs: Mapping[str, Array],
    course: Course,
    fits: Sequence[Callable[[Array, Array], Predict]],
    most: int,
) -> Array:
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


def stlsq(table: Array, residual: Array, folds: NDArray[np.intp]) -> Array:
    """Weights, shape (columns,), by a table, shape (n, columns); `folds` are numbers of blocks."""
    norm = np.sqrt(np.mean(table**2, axis=0)) if len(table) else np.ones(table.shape[1])
    norm = np.where(norm > 0, norm, 1.0)
    if len(table) < limits.FEWEST:
        return np.zeros(len(norm))
    return weights_of(table / norm, residual, folds, limits.THRESHOLDS) / norm


@dataclass(frozen=True)
class Discovery:
    """A term, by its column, that is missing in a region, and its weight there."""

    region: int
    column: int
    weight: float


def regions(inputs: Array, learnt: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Number of the region of each row, shape (n,), cut by the `learnt` rows.

    `inputs`, shape (n, inputs), are standardised.
    """
    number = np.zeros(len(inputs), dtype=np.intp)
    for _ in range(limits.DEPTH):
        number = 2 * number + _halves(inputs, learnt, number)
    return np.unique(number, return_inverse=True)[1]


def _halves(inputs: Array, learnt: NDArray[np.bool_], number: NDArray[np.intp]) -> NDArray[np.intp]:
    """1 in the upper half of each region, along its widest input with enough on both sides."""
    upper = np.zeros(len(inputs), dtype=np.intp)
    for region in np.unique(number[learnt]):
        inside = number == region
        own = inputs[inside & learnt]
        for column in np.argsort(-np.std(own, axis=0)):
            middle = np.median(own[:, column])
            above = int((own[:, column] > middle).sum())
            if min(above, len(own) - above) >= limits.FEWEST:
                upper[inside & (inputs[:, column] > middle)] = 1
                break
    return upper


def discovered(table: Array, residual: Array, region: NDArray[np.intp]) -> list[Discovery]:
    """Terms that are certified, by a table, shape (n, columns); others have shape (n,)."""
    regions = [r for r in np.unique(region) if (region == r).sum() >= limits.FEWEST]
    energy = {r: float(np.mean(residual[region == r] ** 2)) for r in regions}
    if len(regions) < 2:
        return []
    clean = min(regions, key=lambda r: energy[r])
    flagged = [r for r in regions if _flagged(r, clean, region, energy)]
    found = [(r, *_selected(table[region == r], residual[region == r])) for r in flagged]
    if not found:
        return []
    adjusted = false_discovery_control([p for _, _, p in found])
    return [
        Discovery(int(r), j, _weight(table[region == r][:, j], residual[region == r]))
        for (r, j, _), p in zip(found, adjusted, strict=True)
        if p <= limits.FALSE
    ]


def _flagged(r: int, clean: int, region: NDArray[np.intp], energy: dict[int, float]) -> bool:
    """Is there more energy than in the clean region, by more than chance?"""
    counts = int((region == r).sum()), int((region == clean).sum())
    ratio = energy[r] / max(energy[clean], 1e-300)
    return r != clean and bool(f_distribution.sf(ratio, *counts) <= limits.FALSE)


def _selected(table: Array, residual: Array) -> tuple[int, float]:
    """The column that predicts best what it was not fitted to, and its p on a third part."""
    part = np.arange(len(residual)) * 9 // len(residual) % 3  # alternating blocks of time
    fit, hold, test = (part == k for k in range(3))
    off = [
        np.sum((residual[hold] - column[hold] * _weight(column[fit], residual[fit])) ** 2)
        for column in table.T
    ]
    j = int(np.argmin(off))
    column, own = table[test, j], residual[test]
    left = float(np.sum((own - column * _weight(column, own)) ** 2))
    gain = float(np.sum(own**2)) - left
    freedom = len(own) - 1
    return j, float(f_distribution.sf(gain * freedom / max(left, 1e-300), 1, freedom))


def _weight(column: Array, residual: Array) -> float:
    square = float(column @ column)
    return float(column @ residual) / square if square > 0 else 0.0
