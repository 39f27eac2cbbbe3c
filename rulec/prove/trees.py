"""A residual learnt by boosted trees; cross-validation over chunks of time chooses their number."""

from __future__ import annotations

from itertools import islice

import numpy as np

from rulec.prove.aligned import Array, Columns, Course
from rulec.prove.limits import FEWEST_IN_A_LEAF, FOLDS, MOST_TREES, TREE_LEAVES, TREE_RATE


def mended_by_trees(drivers: Columns, course: Course) -> Array:
    """The recalibrated prediction with the learnt residual added, shape (n,)."""
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
    """Trees that predict chunks best from the others; none where that is best."""
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
