"""Baselines that learn the residual of a model: held-out errors beside those of a repaired model.

They predict, but name nothing: no place, no cause, no parameter with a unit. All choices are fixed,
or made by cross-validation, over blocks in time, on samples that are not held out.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from rulec.prove.aligned import Array, Columns, Course, at_times, drivers_of, lagged, rms
from rulec.prove.limits import FEWEST_IN_A_LEAF, FOLDS, MOST_TREES, TREE_LEAVES, TREE_RATE
from rulec.prove.sparse import mended_by_law, mended_by_map


@dataclass(frozen=True, kw_only=True)
class Baselines:
    """Root mean square errors on held-out samples, in the unit of the signal.

    `points` is the number of samples. `ran_away` tells that the simulation of PySINDy diverged; its
    error is then that of recalibration.
    """

    points: int
    recalibrated: float
    trees: float
    sindy: float
    ran_away: bool

    @property
    def ratios(self) -> dict[str, float]:
        """Errors over that of recalibration."""
        if not self.recalibrated > 0:
            return {}
        return {
            "boosted trees": self.trees / self.recalibrated,
            "PySINDy": self.sindy / self.recalibrated,
        }


def stationary_baselines(columns: Columns, course: Course, own: Sequence[str] = ()) -> Baselines:
    """Learn from all readings of a sample except the predicted one.

    Parameters
    ----------
    columns : of the recording by header, `time [s]` included.
    own : headers of the predicted signal, if they do not begin with its id.
    """
    drivers = drivers_of(columns, course, own)
    with one_thread():
        trees = mended_by_trees(drivers, course)
        sparse = mended_by_law(drivers, course)
    return _errors(course, trees, sparse.mended, sparse.ran_away)


def dynamic_baselines(columns: Columns, course: Course, inputs: Sequence[str]) -> Baselines:
    """Learn from the inputs and the model's prediction, now and before.

    Parameters
    ----------
    inputs : headers of the simulation's inputs; no reading of a state may be among them.
    """
    aligned = at_times(columns, course.time)
    given = {header: aligned[header] for header in inputs}
    with one_thread():
        trees = mended_by_trees(lagged({**given, "predicted": course.recalibrated}), course)
        sparse = mended_by_map(given, course)
    return _errors(course, trees, sparse.mended, sparse.ran_away)


def _errors(course: Course, trees: Array, sindy: Array, ran_away: bool) -> Baselines:
    def error(predicted: Array) -> float:
        return rms((predicted - course.measured)[course.judged])

    return Baselines(
        points=int(course.judged.sum()),
        recalibrated=error(course.recalibrated),
        trees=error(trees),
        sindy=error(sindy),
        ran_away=ran_away,
    )


def mended_by_trees(drivers: Columns, course: Course) -> Array:
    """Add the residual that boosted trees learn to the recalibrated prediction, shape (n,)."""
    residual, folds = course.residual, course.folds
    if not drivers or (folds >= 0).sum() < FOLDS * FEWEST_IN_A_LEAF:
        return course.recalibrated
    features = np.column_stack(list(drivers.values()))
    count = _count(features, residual, folds)
    if not count:
        return course.recalibrated
    learner = _learner(count).fit(features[folds >= 0], residual[folds >= 0])
    mended: Array = course.recalibrated + learner.predict(features)
    return mended


def _count(features: Array, residual: Array, folds: np.ndarray) -> int:
    """Number of trees with the least error in cross-validation; 0 if no tree is best."""
    squares = np.zeros(MOST_TREES + 1)
    for fold in range(FOLDS):
        there, other = folds == fold, (folds >= 0) & (folds != fold)
        learner = _learner(MOST_TREES).fit(features[other], residual[other])
        squares[0] += np.sum(residual[there] ** 2)
        stages = islice(learner.staged_predict(features[there]), MOST_TREES)
        for i, predicted in enumerate(stages, 1):
            squares[i] += np.sum((residual[there] - predicted) ** 2)
    return int(np.argmin(squares))


def _learner(count: int):  # type: ignore[no-untyped-def]
    # Imported here: it takes seconds that only the baselines need.
    from sklearn.ensemble import HistGradientBoostingRegressor

    return HistGradientBoostingRegressor(
        max_iter=count,
        learning_rate=TREE_RATE,
        max_leaf_nodes=TREE_LEAVES,
        min_samples_leaf=FEWEST_IN_A_LEAF,
        early_stopping=False,
        random_state=0,
    )


def one_thread() -> AbstractContextManager[Any]:
    """Limit numerical libraries to one thread.

    Threads cost more than they save on small matrices, and cases run side by side.
    """
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[Any] = threadpool_limits(1)
    return limits
