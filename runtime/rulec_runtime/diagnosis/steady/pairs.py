"""Two faults at once, where no single one fits: a sparse non-negative fit.

To first order simultaneous faults add up, so linear effects screen all pairs at once; the best
ones are then fitted in full. Two is the end: each further degree takes away evidence.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.hypothesis import (
    FirstOrder,
    HypothesisTest,
    Outcome,
    pair_starts,
)


@dataclass(frozen=True)
class PairFits:
    """Fitted pairs: indexes of faults, and per pair and point degrees and uncertainties, shape
    (pairs, n, 2), and log-likelihood, shape (pairs, n), -inf where the pair does not fit."""

    pairs: tuple[tuple[int, int], ...]
    degree: Array
    u: Array
    evidence: Array


def fit_pairs(test: HypothesisTest, limit: float) -> PairFits:
    """Fit the pairs that pass the screening; `limit` is the distance up to which one fits."""
    fitted = [(pair, _fit(test, pair)) for pair in _screened(test)]
    sound = [(pair, outcome) for pair, outcome in fitted if outcome is not None]
    evidence = [np.where(o.distance <= limit, o.evidence, -np.inf) for _, o in sound]
    return PairFits(
        tuple(pair for pair, _ in sound),
        np.array([o.degree for _, o in sound]),
        np.array([o.u for _, o in sound]),
        np.array(evidence).reshape(len(sound), -1),
    )


def _screened(test: HypothesisTest) -> list[tuple[int, int]]:
    """Pairs whose linear effects come closest to the residuals at some point."""
    pairs, left = [], []
    for pair, distance in _linear(test):
        pairs.append(pair)
        left.append(distance)
    if not pairs:
        return []
    order = np.argsort(np.array(left), axis=0)[: limits.PAIRS_SCREENED]
    return [pairs[k] for k in np.unique(order)]


def _linear(test: HypothesisTest) -> Iterator[tuple[tuple[int, int], Array]]:
    """Distance left by each pair with linear effects and non-negative degrees."""
    chi = test.chi_square
    effects = dict(_effects(test))
    weighted = {
        i: np.einsum("fin,in->fn", chi.curvature[:, e.flows], e.slope) for i, e in effects.items()
    }
    size = {i: np.sum(e.slope * weighted[i][e.flows], axis=0) for i, e in effects.items()}
    pull = {i: -np.sum(e.slope * chi.slope[e.flows], axis=0) for i, e in effects.items()}
    for i, j in combinations(effects, 2):
        cross = np.sum(effects[j].slope * weighted[i][effects[j].flows], axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            determinant = size[i] * size[j] - cross**2
            a = (size[j] * pull[i] - cross * pull[j]) / determinant
            b = (size[i] * pull[j] - cross * pull[i]) / determinant
            left = chi.value - a * pull[i] - b * pull[j]
        # Effects in the same direction leave nothing but rounding in the determinant, and the fit
        # would refuse them: they must not take the place of a pair that can be told apart.
        apart = determinant > limits.DEGREES_APART * size[i] * size[j]
        both = apart & (a > 0) & (b > 0) & np.isfinite(left)
        if np.any(both):
            yield (i, j), np.where(both, left, np.inf)


def _effects(test: HypothesisTest) -> Iterator[tuple[int, FirstOrder]]:
    """What small degrees of the faults do, where residuals see them."""
    for i, fault in enumerate(test.ruleset.faults):
        first = test.first_order(fault)
        if first is not None and np.any(first.slope):
            yield i, first


def _fit(test: HypothesisTest, pair: tuple[int, int]) -> Outcome | None:
    """Fit both degrees in full."""
    first, second = (test.ruleset.faults[i] for i in pair)
    return test.run((first, second), pair_starts())
