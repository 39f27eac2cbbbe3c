"""A residual by sparse regression (PySINDy): as a law of readings, or as a map from step to step.

Thresholds are chosen by cross-validation over blocks in time. A map is simulated freely from its
first known value through the whole record, also through held-out blocks, as the plant's model is.

Source: Brunton, Proctor, Kutz 2016, with sequentially thresholded least squares.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rulec.prove.aligned import Array, Columns, Course, rms
from rulec.prove.limits import (
    FEWEST_SAMPLES,
    FOLDS,
    MOST_COLUMNS,
    RAN_AWAY,
    SHORTEST_RUN,
    SPARSE_DEGREE,
    SPARSE_RIDGE,
    SPARSE_ROUNDS,
    SPARSE_THRESHOLDS,
)


@dataclass(frozen=True)
class Sparse:
    """The corrected prediction, shape (n,); `ran_away`: it is the recalibrated one, as the map
    diverged."""

    mended: Array
    ran_away: bool = False


def mended_by_law(drivers: Columns, course: Course) -> Sparse:
    """Model the residual of a stationary plant as a polynomial of the readings."""
    residual, folds = course.residual, course.folds
    size = rms(residual[folds >= 0])
    if not drivers or (folds >= 0).sum() < FEWEST_SAMPLES or not size > 0:
        return Sparse(course.recalibrated)
    columns = _standardised(_most_correlated(drivers, course), folds >= 0)
    library = _library().fit(columns)
    terms = np.asarray(library.transform(columns))
    target = residual / size

    def predicted(threshold: float, part: NDArray[np.bool_]) -> Array:
        optimizer = _optimizer(threshold)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a threshold that drops every term is a result
            optimizer.fit(terms[part], target[part, None])
        law: Array = terms @ np.asarray(optimizer.coef_)[0]
        return law

    squares = [np.sum(target[folds >= 0] ** 2)]
    for threshold in SPARSE_THRESHOLDS:
        parts = ((folds == k, (folds >= 0) & (folds != k)) for k in range(FOLDS))
        wrong = (np.sum((predicted(threshold, o) - target)[k] ** 2) for k, o in parts)
        squares.append(sum(wrong))
    best = int(np.argmin(squares))
    if not best:
        return Sparse(course.recalibrated)
    return Sparse(course.recalibrated + size * predicted(SPARSE_THRESHOLDS[best - 1], folds >= 0))


def mended_by_map(inputs: Columns, course: Course) -> Sparse:
    """Model a plant that stores: the next residual from this one, inputs and prediction."""
    residual, folds = course.residual, course.folds
    size = rms(residual[folds >= 0])
    if (folds >= 0).sum() < FEWEST_SAMPLES or not size > 0:
        return Sparse(course.recalibrated)
    control = _standardised({**inputs, "predicted": course.recalibrated}, folds >= 0)
    state, start = residual / size, int(np.argmax(folds >= 0))
    bound = RAN_AWAY * float(np.max(np.abs(state[folds >= 0])))

    def simulated(threshold: float, part: NDArray[np.bool_]) -> Array | None:
        model = _map(state, control, part, threshold)
        return None if model is None else _run(model, state[start], control, start, bound)

    squares = [float(np.sum(state[folds >= 0] ** 2))]
    for threshold in SPARSE_THRESHOLDS:
        total = 0.0
        for fold in range(FOLDS):
            free = simulated(threshold, (folds >= 0) & (folds != fold))
            total += np.inf if free is None else float(np.sum((free - state)[folds == fold] ** 2))
        squares.append(total)
    best = int(np.argmin(squares))
    if not best:
        return Sparse(course.recalibrated, not np.isfinite(squares[1:]).any())
    free = simulated(SPARSE_THRESHOLDS[best - 1], folds >= 0)
    if free is None:
        return Sparse(course.recalibrated, True)
    return Sparse(course.recalibrated + size * free)


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


def _standardised(columns: Columns, learnt: NDArray[np.bool_]) -> Array:
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


def _map(state: Array, control: Array, part: NDArray[np.bool_], threshold: float) -> Any:
    """The fitted map; None if no run of samples is long enough."""
    import pysindy

    edges = np.flatnonzero(np.diff(np.concatenate([[0], part.astype(int), [0]])))
    runs = [slice(a, b) for a, b in edges.reshape(-1, 2) if b - a >= SHORTEST_RUN]
    if not runs:
        return None
    model = pysindy.DiscreteSINDy(optimizer=_optimizer(threshold), feature_library=_library())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit([state[r, None] for r in runs], t=1, u=[control[r] for r in runs])
    return model


def _run(model: Any, first: float, control: Array, start: int, bound: float) -> Array | None:
    """The free course from `start`, 0 before it; None if it diverges."""
    powers = np.asarray(model.feature_library.powers_)
    weights = np.asarray(model.coefficients())[0]
    kept = weights != 0
    powers, weights = powers[kept], weights[kept]
    # The control is known beforehand, which leaves one number per sample and power of the state.
    by_power = np.zeros((len(control), SPARSE_DEGREE + 1))
    for power, weight in zip(powers, weights, strict=True):
        by_power[:, power[0]] += weight * np.prod(control ** power[1:], axis=1)
    course = np.zeros(len(control))
    value = course[start] = float(first)
    for k in range(start, len(control) - 1):
        value = float(sum(by_power[k, p] * value**p for p in range(SPARSE_DEGREE + 1)))
        if not abs(value) < bound:
            return None
        course[k + 1] = value
    return course


def _library() -> Any:
    import pysindy

    return pysindy.PolynomialLibrary(degree=SPARSE_DEGREE)


def _optimizer(threshold: float) -> Any:
    import pysindy

    return pysindy.STLSQ(threshold=threshold, alpha=SPARSE_RIDGE, max_iter=SPARSE_ROUNDS)
