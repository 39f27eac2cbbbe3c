"""Which operating points tell explanations apart best, one after the other.

A step is worth the probability that the true explanation has after it, if its odds against each
other one grow by the expected log Bayes factor. Under two normal distributions of what is read,
that is their divergence. How sure the true one can be expected to be is less: see `certainty.py`.

Source: Box and Hill 1967; Hunter and Reiner 1965 (discrimination between models); Kullback and
Leibler 1951.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from scipy.linalg import solve_triangular

from rulec.mismatch import limits
from rulec.mismatch.experiment.foretell import Foretold


@dataclass(frozen=True)
class Choice:
    """Places in the order in which they were chosen, what is `worth` nothing and each of them, and
    the `factors` by which all tell explanations apart.

    `factors`, shape (explanations, explanations), are expected log Bayes factors, nats: of the one
    of a row, if it is true, against the one of a column.
    """

    places: tuple[int, ...]
    worth: tuple[float, ...]
    factors: Array


def chosen(
    foretold: Sequence[Foretold],
    odds: Array,
    most: int,
    *,
    among: NDArray[np.bool_] | None = None,
    in_time: Callable[[Sequence[int]], bool] = lambda places: True,
) -> Choice:
    """Up to so many places, each the one that adds most to what is known by then.

    `foretold` has one entry per explanation as the true one, `odds` their probabilities. `among`,
    shape (n,), flags places that may be chosen; `in_time` tells whether there is time for some.
    """
    places: list[int] = []
    count = len(odds)
    factors = np.zeros((count, count))
    worth = [certain(odds, factors)]
    every = sorted(set(foretold[0].point.tolist()).intersection(*(f.point for f in foretold)))
    if among is not None:
        every = [place for place in every if among[place]]
    while len(places) < most:
        trials = [
            (place, factors_of(foretold, [*places, place]))
            for place in every
            if in_time([*places, place])
        ]
        best, told = max(trials, key=lambda trial: certain(odds, trial[1]), default=(-1, factors))
        if best < 0 or certain(odds, told) < worth[-1] + limits.WORTH_A_STEP:
            break
        places.append(best)
        factors = told
        worth.append(certain(odds, factors))
    return Choice(tuple(places), tuple(worth), factors)


def certain(odds: Array, factors: Array) -> float:
    """Probability of the true explanation where factors are as large as they are expected to be."""
    with np.errstate(divide="ignore"):
        logs = np.log(odds)
    after = logs[:, None] - logs[None, :] + factors
    return float(np.sum(odds / np.exp(-after).sum(axis=1)))


def factors_of(foretold: Sequence[Foretold], places: Sequence[int]) -> Array:
    """Expected log Bayes factors by what is read at some places, shape (explanations,
    explanations), nats."""
    count = len(foretold)
    factors = np.zeros((count, count))
    for true, told in enumerate(foretold):
        at = np.flatnonzero(np.isin(told.point, places))
        parts = [_factor(told, at, number) for number in range(count)]
        for other, (off, spread) in enumerate(parts):
            if other != true:
                factors[true, other] = _divergence(parts[true], (off, spread))
    return np.maximum(factors, 0.0)


Normal = tuple[Array, Array]
"""Mean, shape (rows,), and lower factor of the covariance, shape (rows, rows)."""


def _factor(told: Foretold, at: NDArray[np.intp], number: int) -> Normal:
    factor = np.asarray(np.linalg.cholesky(told.covariance[number][np.ix_(at, at)]), dtype=float)
    return told.off[number][at], factor


def _divergence(true: Normal, other: Normal) -> float:
    """Divergence of a normal distribution from another, nats."""
    away = solve_triangular(other[1], true[0] - other[0], lower=True)
    between = solve_triangular(other[1], true[1], lower=True)
    grown = float(np.sum(np.log(np.diag(other[1]))) - np.sum(np.log(np.diag(true[1]))))
    return grown + 0.5 * float(away @ away + np.sum(between**2) - len(away))
