"""Which operating points tell explanations apart best, one after the other, and how long to hold
each.

A step is worth the probability that the true explanation has after it. Its odds against each other
one grow by a log Bayes factor, of which the mean is known: under two normal distributions of what
is read, that is their divergence. It scatters. What is read does, so that a factor of mean `f` has
a variance of `2 f`, as between normal distributions of one covariance; and `rulec mismatch` weighs
parts of the recording at random. With the mean alone some few steps would always seem to be enough.
How sure the true one can be expected to be is told with readings drawn, in `certainty.py`, which
takes longer.

Steps that are held longer have less noise, and cost time: each doubling has to be worth it.

Source: Box and Hill 1967; Hunter and Reiner 1965 (discrimination between models); Kullback and
Leibler 1951.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from scipy.special import gammaincinv

from rulec.mismatch.experiment import limits
from rulec.mismatch.experiment.divergence import divergences
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
    factors, weighed = np.zeros((count, count)), np.zeros((count, count))
    worth, added = [certain(odds, factors, weighed)], list[Array]()
    every = sorted(set(foretold[0].point.tolist()).intersection(*(f.point for f in foretold)))
    if among is not None:
        every = [place for place in every if among[place]]
    left = list(range(len(every)))
    known = [divergences(told, true, every) for true, told in enumerate(foretold)]
    while len(places) < most and left:
        more = np.array([[pair.gains() for pair in row] for row in known])
        sure = [
            certain(odds, factors + own, weighed + own**2) if in_time([*places, every[at]]) else 0.0
            for at, own in zip(left, np.moveaxis(more, 2, 0), strict=True)
        ]
        best = int(np.argmax(sure))
        if not sure[best] > 0.0:
            break
        at = left.pop(best)
        places.append(every[at])
        added.append(more[:, :, best])
        factors, weighed = factors + added[-1], weighed + added[-1] ** 2
        worth.append(sure[best])
        known = [[pair.with_place(at) for pair in row] for row in known]
    # One step may tell nothing where two do.
    kept = int(np.argmax(np.array(worth) - limits.WORTH_A_STEP * np.arange(len(worth))))
    factors = np.sum([np.zeros((count, count)), *added[:kept]], axis=0)
    return Choice(tuple(places[:kept]), tuple(worth[: kept + 1]), factors)


NODES, SHARES = np.polynomial.hermite_e.hermegauss(limits.SCATTER_NODES)
"""Where a normal deviate is taken, and for which share of its draws each stands."""

WEIGHTS = (np.arange(limits.SCATTER_NODES) + 0.5) / limits.SCATTER_NODES
"""Shares of draws below which a weight is taken; each stands for as many."""


def certain(odds: Array, factors: Array, weighed: Array) -> float:
    """Probability that the true explanation can be expected to have.

    `factors` are expected log Bayes factors, nats, `weighed` the sum of the squares of what each
    step adds to them, shape (explanations, explanations) each. The mean weight of steps has a gamma
    distribution if each has an exponential one and all add as much.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(odds)
        alike = np.where(weighed > 0.0, factors**2 / weighed, 1.0)
    weights = gammaincinv(alike, WEIGHTS[:, None, None]) / alike
    read = factors + NODES[:, None, None] * np.sqrt(2.0 * factors)
    after = logs[:, None] - logs[None, :] + weights[:, None] * read[None]
    with np.errstate(over="ignore"):
        sure = (1.0 / np.exp(-after).sum(axis=3)).mean(axis=0)
    return float(SHARES @ sure @ odds / SHARES.sum())
