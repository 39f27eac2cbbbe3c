"""Baselines that learn the residual of a model: held-out errors beside those of a repaired model.

They predict and name nothing: no place, no cause, no parameter with a unit. All choices are fixed,
or made by cross-validation on samples that are not held out.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

from rulec.prove.aligned import Columns, Course, at_times, drivers_of, lagged, rms
from rulec.prove.sparse import mended_by_law, mended_by_map
from rulec.prove.trees import mended_by_trees


@dataclass(frozen=True, kw_only=True)
class Baselines:
    """Root mean square errors on held-out samples, in the unit of the signal.

    `points` is the number of samples; `ran_away`: the simulation of PySINDy diverged, and its
    error is that of recalibration.
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
    """Learn from all readings of a sample but the predicted one.

    Parameters
    ----------
    columns : of the recording by header, `time [s]` among them.
    own : headers of the predicted signal, if they do not begin with its id.
    """
    drivers = drivers_of(columns, course, own)
    with one_thread():
        trees = mended_by_trees(drivers, course)
        sparse = mended_by_law(drivers, course)
    return _errors(course, trees, sparse.mended, sparse.ran_away)


def dynamic_baselines(columns: Columns, course: Course, inputs: Sequence[str]) -> Baselines:
    """Learn from what is given and what the model predicts, now and before.

    Parameters
    ----------
    inputs : headers of what is given to the simulation; no reading of a state may be among them.
    """
    aligned = at_times(columns, course.time)
    given = {header: aligned[header] for header in inputs}
    with one_thread():
        trees = mended_by_trees(lagged({**given, "predicted": course.recalibrated}), course)
        sparse = mended_by_map(given, course)
    return _errors(course, trees, sparse.mended, sparse.ran_away)


def _errors(course: Course, trees: Any, sindy: Any, ran_away: bool) -> Baselines:
    judged = course.judged
    plain, grown, mapped = (
        rms((predicted - course.measured)[judged])
        for predicted in (course.recalibrated, trees, sindy)
    )
    return Baselines(
        points=int(judged.sum()),
        recalibrated=plain,
        trees=grown,
        sindy=mapped,
        ran_away=ran_away,
    )


def one_thread() -> AbstractContextManager[Any]:
    """Small matrices: threads cost more than they save, and cases run side by side."""
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[Any] = threadpool_limits(1)
    return limits
