"""Does a fault come and go with the operating point? Then it is physics without a name.

A fault does not know at which speed a pump runs. If settings tell when it is there, it follows
them: where one lies, what share of another it has, or which way it changed last.

Source: Youden 1950 for the index.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch import limits
from rulec.mismatch.evidence.region import best_interval
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.screen import InitialCandidate
from rulec.mismatch.search.periods import speaking


def with_settings(fitted: Fitted, trial: InitialCandidate) -> bool:
    """Does what is set tell when a fault is there, at points that speak of it?

    Parameters
    ----------
    fitted : the model without the fault.
    """
    course = trial.course
    if course is None or len(course.periods) < 2:
        return False
    seen = fitted.used & speaking(fitted, trial.candidate)
    there = (course.segment >= 0)[seen]
    if int(np.sum(there[1:] != there[:-1])) < limits.COINCIDING_ENDS:
        return False
    features = [values[seen] for values in _features(fitted)]
    told = _told(there, features)
    if told < limits.COINCIDES:
        return False
    shifts = np.linspace(0, len(there), limits.SHIFTS + 2).astype(int)[1:-1]
    return all(_told(np.roll(there, shift), features) < told for shift in shifts)


def _told(there: np.ndarray, features: Sequence[Array]) -> float:
    """How well the best of all readings tells a state, by an interval: 1 without any error.

    >>> there = np.array([0, 0, 1, 1, 0, 0, 1, 1, 0, 0], dtype=bool)
    >>> round(_told(there, [np.array([1, 1, 3, 3, 1, 1, 3, 3, 1, 1.0])]), 3)
    1.0
    >>> round(_told(there, [np.arange(10.0)]), 3) < limits.COINCIDES
    True
    """
    best = 0.0
    for state in (there.astype(float), 1.0 - there):
        for values in features:
            found = best_interval(values, state / state.sum())
            if found is not None:
                best = max(best, found[0] / (1.0 - float(state.mean())))
    return best


def _features(fitted: Fitted) -> Iterator[Array]:
    """What is set, shares of one setting in two of the same unit, and the way of the last change.

    Other readings may show the fault itself.
    """
    data = fitted.rows.system.data
    signals = fitted.rows.system.ruleset.signal_by_id
    known = {name: values for name, values in data.values.items() if name in signals}
    set_ = {n: v for n, v in known.items() if signals[n].is_input and np.isfinite(v).all()}
    for name, values in set_.items():
        yield values
        yield _way(values, limits.CLEARLY * float(np.median(data.noise[name])))
    for one, other in itertools.combinations(set_, 2):
        if signals[one].unit == signals[other].unit:
            with np.errstate(invalid="ignore", divide="ignore"):
                yield set_[one] / (set_[one] + set_[other])


def _way(values: Array, least: float) -> Array:
    """1 after a reading rose, -1 after it fell, 0 before it changed, shape (n,).

    >>> _way(np.array([2.0, 2.1, 5.0, 5.1, 3.0, 2.9]), 0.5).tolist()
    [0.0, 0.0, 1.0, 1.0, -1.0, -1.0]
    """
    least = max(least, limits.MOVED * float(np.nanmax(values) - np.nanmin(values)))
    way, side, low, high = np.zeros(len(values)), 0.0, values[0], values[0]
    for i, value in enumerate(values):
        low, high = min(low, value), max(high, value)
        if value - low > least:
            side, low, high = 1.0, value, value
        elif high - value > least:
            side, low, high = -1.0, value, value
        way[i] = side
    return way
