"""Which operating points tell explanations apart, how long to hold them, and which cover the rest.

A step is worth what it adds to the expected probability of the true explanation. The odds of that
one against another grow by a log Bayes factor; between normal distributions its mean is their
divergence f, and its variance 2 f if their covariances are alike. Holding steps longer averages
noise and costs time, so each doubling has to be worth it.

Steps that tell explanations apart are as good as those explanations. The truth may be none of them,
or bend where nobody recorded; so the other steps lie far from each other along each input.

Source: Box and Hill 1967; Hunter and Reiner 1965 (discrimination between models); Kullback and
Leibler 1951; Cover and Thomas 2006, 2.5 (chain rule of divergences); Joseph, Gul and Ba 2015
(maximum projection designs); Box and Draper 1959.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.mismatch import limits
from rulec.mismatch.experiment.foretell import Foretold
from rulec.mismatch.experiment.points import Feasible


@dataclass(frozen=True)
class Choice:
    """Places in the order in which they were chosen.

    `certainty` is the expected probability of the true explanation before the first and after each,
    `worth` that after all of them if it is one of these. `factors`, shape (explanations,
    explanations), are expected log Bayes factors, nats: of the explanation of a row, if it is true,
    against that of a column.
    """

    places: tuple[int, ...]
    certainty: tuple[float, ...]
    worth: float
    factors: Array


def chosen(
    told: Sequence[Foretold],
    odds: Array,
    most: int,
    *,
    among: NDArray[np.bool_] | None = None,
    in_time: Callable[[Sequence[int]], bool] = lambda places: True,
) -> Choice:
    """Up to so many places, each the one that adds most to what is known by then.

    `told` has one entry per explanation as the true one, `odds` their probabilities. `among`, shape
    (n,), flags places that may be chosen; `in_time` says whether there is time for some.
    """
    every = sorted(set(told[0].point.tolist()).intersection(*(one.point for one in told)))
    left = [place for place in every if among is None or among[place]]
    places: list[int] = []
    factors = [np.zeros((len(odds), len(odds)))]
    shares = odds / odds.sum()
    worth = [certain(shares, factors[0])]
    while left and len(places) < most:
        grown = factors[-1][:, :, None] + np.array(
            [gains(one, true, places, left) for true, one in enumerate(told)]
        )
        sure = [
            certain(shares, own) if in_time([*places, place]) else 0.0
            for place, own in zip(left, np.moveaxis(grown, 2, 0), strict=True)
        ]
        best = int(np.argmax(sure))
        if not sure[best] > 0.0:
            break
        places.append(left.pop(best))
        factors.append(grown[:, :, best])
        worth.append(sure[best])
    # One step may tell nothing where two do.
    kept = int(np.argmax(np.array(worth) - limits.WORTH_A_STEP * np.arange(len(worth))))
    certainty = tuple(certain(odds, own) for own in factors[: kept + 1])
    return Choice(tuple(places[:kept]), certainty, worth[kept], factors[kept])


NODES, SHARES = np.polynomial.hermite_e.hermegauss(limits.SCATTER_NODES)
"""Where a normal deviate is taken, and for which share of its draws each stands."""


def certain(odds: Array, factors: Array) -> float:
    """Probability that the true explanation can be expected to have.

    `factors` are expected log Bayes factors, nats, shape (explanations, explanations). What `odds`
    lack to 1 is none of these: no reading counts against it, and where it is true nothing is
    gained.
    """
    unlisted = max(1.0 - float(odds.sum()), 0.0)
    read = factors + NODES[:, None, None] * np.sqrt(2.0 * factors)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        others = (odds[None, :] / odds[:, None] * np.exp(-read)).sum(axis=2)
        sure = np.where(odds > 0.0, 1.0 / (others + unlisted / odds), 0.0)
    return float(SHARES @ sure @ odds / SHARES.sum())


def gains(told: Foretold, true: int, known: Sequence[int], places: Sequence[int]) -> Array:
    """By how much each place would raise the expected log Bayes factors of the true explanation
    against each, after readings at the known places; nats, shape (explanations, places)."""
    before, rows = _rows(told, known), _rows(told, places)
    read = before[before >= 0]
    first, by_true, own = _conditional(told, true, read, rows)
    found = []
    for other, off in enumerate(told.off):
        factor, by, left = _conditional(told, other, read, rows)
        apart = told.off[true] - off
        mean = np.where(rows >= 0, apart[rows], 0.0)
        mean -= np.einsum("kni,k->ni", by, np.linalg.solve(factor, apart[read]))
        spread = np.einsum("kni->nik", by_true)
        spread = spread - np.einsum("kni,kl->nil", by, np.linalg.solve(factor, first))
        parts = np.concatenate([mean[:, :, None], spread, own], axis=2)
        squares = (np.linalg.solve(left, parts) ** 2).sum(axis=(1, 2))
        grown = np.linalg.slogdet(left)[1] - np.linalg.slogdet(own)[1]
        found.append(np.maximum(grown + 0.5 * (squares - rows.shape[1]), 0.0))
    return np.array(found)


def _rows(told: Foretold, places: Sequence[int]) -> NDArray[np.intp]:
    """Numbers of the rows of each place, shape (places, r); a negative one says nothing."""
    own = [np.flatnonzero(told.point == place) for place in places]
    most = int(np.bincount(told.point).max())
    number = np.tile(-1 - np.arange(most), (len(places), 1))
    for line, there in zip(number, own, strict=True):
        line[: len(there)] = there
    return number


def _conditional(
    told: Foretold, explanation: int, read: NDArray[np.intp], rows: NDArray[np.intp]
) -> tuple[Array, Array, Array]:
    """Lower factor of the covariance of what was read, shape (k, k); the covariance of rows with
    that in its units, shape (k, n, r); and the factors of what it leaves, shape (n, r, r)."""
    between = functools.partial(told.between, explanation)
    factor = np.linalg.cholesky(between(read[:, None], read[None, :]))
    by = np.linalg.solve(factor, between(read[:, None], rows.reshape(1, -1)))
    by = by.reshape(len(read), *rows.shape)
    left = between(rows[:, :, None], rows[:, None, :]) - np.einsum("kni,knj->nij", by, by)
    return np.asarray(factor), np.asarray(by), np.asarray(np.linalg.cholesky(left))


@dataclass(frozen=True)
class Best:
    """Places that were chosen within limits, and what each explanation foretells of means as long
    as they are held; readings whose limits forbid better ones, and whether time does."""

    choice: Choice
    told: Sequence[Foretold]
    limited: Feasible
    hindering: tuple[str, ...]
    time_is_short: bool


def best_within(
    told: Sequence[Foretold],
    odds: Array,
    most: int,
    seconds: float,
    limited: Feasible,
    settling: float,
) -> Best:
    """The places that tell most within limits, and how long to hold them; readings take `settling`,
    s. Places that cost no product are preferred."""

    def plan(held: int, among: NDArray[np.bool_], until: float = seconds) -> Choice:
        longer, own = _held(told, limited, held, settling)
        return chosen(
            longer,
            odds,
            most,
            among=among,
            in_time=lambda places: own.seconds(places) <= until,
        )

    @functools.cache
    def best(held: int) -> Choice:
        choice = plan(held, limited.may_run)
        if any(limited.costs[place] for place in choice.places):
            spared = plan(held, limited.free)
            if spared.worth >= choice.worth - limits.WORTH_COST:
                return spared
        return choice

    def worth(held: int) -> float:
        return best(held).worth - limits.WORTH_COST * math.log2(held)

    longest, held = max(int(seconds // limited.seconds([0])), 1), 1
    while longer := [h for h in (2 * held, 4 * held) if h <= longest and worth(h) > worth(held)]:
        held = max(longer, key=worth)
    choice = best(held)
    unhurried = [plan(times, limited.may_run, math.inf) for times in (held, 2 * held)]
    wider = plan(held, limited.possible) if limited.forbidden else choice
    better = wider.worth > choice.worth + limits.WORTH_A_STEP
    forbid = [n for n, there in limited.forbidden.items() if there[list(wider.places)].any()]
    return Best(
        choice,
        *_held(told, limited, held, settling),
        tuple(forbid) if better else (),
        any(one.worth > choice.worth + limits.WORTH_COST for one in unhurried),
    )


def _held(
    told: Sequence[Foretold], limited: Feasible, held: int, settling: float
) -> tuple[Sequence[Foretold], Feasible]:
    """What is foretold where each place is held so many times as long as it has to be."""
    least = limited.shortest - settling
    times = (held * limited.shortest - settling) / least if least > 0.0 else float(held)
    return [one.held(times) for one in told], replace(limited, held=held)


def covering(
    limited: Feasible, among: NDArray[np.bool_], steps: Sequence[int], most: int, seconds: float
) -> tuple[int, ...]:
    """Up to so many places beside some steps, as long as there is time, s.

    Each is the one farthest from all others by the product of distances along each input; without
    any step the first is the middle. `among`, shape (n,), flags places that may be chosen.
    """
    ranges = limited.reach.ranges.items()
    at = np.stack([(limited.places.inputs[n] - low) / (high - low) for n, (low, high) in ranges], 1)

    def near(point: Array) -> Array:
        """What one point adds to the criterion at all places: infinite where they coincide."""
        apart = np.abs(at - point)
        # Values of an input are as good as apart where `most` evenly spread ones are.
        added: Array = 1.0 / np.prod(apart + 1.0 / most, axis=1) ** 2
        return np.where(apart.any(axis=1), added, np.inf)

    found: list[int] = []
    while len(found) < most:
        taken = [*steps, *found]
        left = [place for place in np.flatnonzero(among).tolist() if place not in taken]
        worst = np.sum([near(at[place]) for place in taken], axis=0)
        if not taken:
            worst = np.linalg.norm(at - at.mean(axis=0), axis=1)
        place = min(left, key=worst.__getitem__, default=-1)
        if place < 0 or worst[place] == np.inf or limited.seconds([*found, place]) > seconds:
            break
        found.append(place)
    return tuple(found)
