"""What all stretches of a run say together, beside the fault-free ones before it.

One operating point cannot tell a sensor's slope from a clogging where both move the same
residuals alike; several can, for the degree that fits one of them must fit all. Errors that last
are the same in all stretches, so residuals are stacked with their joint covariance. The stretches
that the baseline rests on belong to the stack: so it can turn out that they hold the fault too,
or that they held one which has gone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.baseline import Baselines, remembered, times_of
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, Outcome, Scales, pair_starts
from rulec_runtime.diagnosis.steady.isolate import Isolation, accepted, shares
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit, residual_basis

ONSET, THROUGHOUT, ENDED = "onset", "throughout", "ended"
"""When a fault is there: in the run alone, also in the baseline, or in the baseline alone."""


@dataclass(frozen=True)
class Hypothesis:
    """Faults (indexes) with degree, standard uncertainty, probability, and when they are there."""

    faults: tuple[int, ...]
    degrees: tuple[float, ...]
    u: tuple[float, ...]
    probability: float
    when: str

    def bounds(self, fault: int) -> tuple[float, float]:
        """95 % bounds of the degree of one of the faults."""
        place = self.faults.index(fault)
        half = limits.COVERAGE * self.u[place]
        return self.degrees[place] - half, self.degrees[place] + half


@dataclass(frozen=True)
class _Fit:
    faults: tuple[int, ...]
    when: str
    outcome: Outcome


def combine(
    ruleset: Ruleset,
    observed: Observed,
    baselines: Baselines,
    isolation: Isolation,
    members: Sequence[int],
    known: frozenset[int] = frozenset(),
) -> list[Hypothesis]:
    """Hypotheses that fit all stretches of a run, the most probable first; none if none does.

    `observed` is not shifted by baselines; `known` are faults found just before the run.
    """
    points, valid = spread_evenly(observed, members)
    learned = _usable_baseline(observed, baselines.states[baselines.at[members[0]]].learned, valid)
    stack = np.concatenate([learned, points])
    basis = residual_basis(ruleset, valid)
    later = np.repeat([0.0, 1.0], [len(learned), len(points)])
    spread = partial(stacked_covariance, observed, valid, basis, stack)
    test = HypothesisTest(
        ruleset=ruleset,
        observed=observed,
        valid=valid,
        basis=basis,
        members=stack,
        spread=spread,
        present=later,
    )
    fits = list(_onset(test, isolation, members))
    if len(learned):
        fits += _backward(replace(test, present=np.ones(len(stack))), THROUGHOUT)
        fits += _backward(replace(test, present=1.0 - later), ENDED)
    rank = len(basis) * len(stack)
    fits = [
        f for f in fits if f.outcome.distance[0] <= accepted(rank, len(f.faults), isolation.chance)
    ]
    if not fits:
        return []
    evidence = np.array([f.outcome.evidence[0] for f in fits])
    evidence += [limits.KNOWN_FAULT * bool(known & set(f.faults)) for f in fits]
    evidence += [limits.FAULT_FROM_START * (f.when != ONSET) for f in fits]
    probability = shares(evidence[:, None])[:, 0]
    order = np.argsort(-probability, kind="stable")
    return [_hypothesis(fits[k], float(probability[k]), rank) for k in order if probability[k]]


def _hypothesis(fit: _Fit, probability: float, rank: int) -> Hypothesis:
    """Degrees with bounds; stretches that scatter more than they should widen them."""
    freedom, left = rank - len(fit.faults), float(fit.outcome.distance[0])
    wide = 1.0
    if freedom > 0 and left > chi_square_limit(freedom, limits.DISAGREE):
        wide = float(np.sqrt(left / freedom))
    return Hypothesis(
        fit.faults,
        tuple(fit.outcome.degree[0].tolist()),
        tuple((wide * fit.outcome.u[0]).tolist()),
        probability,
        fit.when,
    )


def spread_evenly(
    observed: Observed, members: Sequence[int] | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Some stretches of a run, spread evenly, that share their usable observers."""
    chosen = np.asarray(members)
    patterns, group, counts = np.unique(
        observed.valid[:, chosen], axis=1, return_inverse=True, return_counts=True
    )
    usual = int(np.argmax(counts))
    return _thinned(chosen[np.ravel(group) == usual]), patterns[:, usual]


def _usable_baseline(observed: Observed, learned: Sequence[int], valid: np.ndarray) -> np.ndarray:
    """Stretches of the baseline that have the observers of the run."""
    chosen = np.asarray(learned, dtype=int)
    return _thinned(chosen[observed.valid[:, chosen][valid].all(axis=0)])


def _thinned(points: np.ndarray) -> np.ndarray:
    places = np.linspace(0, len(points) - 1, min(limits.STACKED, len(points))).round().astype(int)
    thinned: np.ndarray = points[places]
    return thinned


def stacked_covariance(
    observed: Observed, valid: np.ndarray, basis: Array, points: np.ndarray, scales: Scales | None
) -> Array:
    """Covariance of the residuals of several points, shape (1, points * rank, points * rank).

    `scales` are factors on the errors of each usable observer.
    """
    rank = len(basis)
    noise, lasting = (
        [basis] * len(points) if part is None else [basis * own for own in part.T]
        for part in ((None, None) if scales is None else (scales.noise, scales.lasting))
    )
    gradients = np.vstack(
        [b @ observed.shared[valid, :, k] for b, k in zip(lasting, points, strict=True)]
    )
    time = np.repeat(times_of(observed)[points], rank)
    covariance = gradients @ gradients.T * remembered(time[:, None] - time)
    for row, point in enumerate(points):
        own = observed.noise[point][np.ix_(valid, valid)]
        block = slice(row * rank, (row + 1) * rank)
        covariance[block, block] += noise[row] @ own @ noise[row].T
    result: Array = covariance[None]
    return result


def _onset(test: HypothesisTest, isolation: Isolation, members: Sequence[int]) -> Iterator[_Fit]:
    """Hypotheses that fit some stretch of the run, with no fault before it."""
    for faults in _candidates(isolation, members):
        start = np.mean(isolation.degree[list(faults)][:, members], axis=1)[None]
        starts = None if len(faults) == 1 else [start, *pair_starts()]
        outcome = test.run(tuple(test.ruleset.faults[i] for i in faults), starts)
        if outcome is not None:
            yield _Fit(faults, ONSET, outcome)


def _candidates(isolation: Isolation, members: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Single faults, or pairs where only pairs fit."""
    chance = isolation.probability[:, members].max(axis=1)
    pairs = isolation.pair[members[0], 0] >= 0
    likely = np.flatnonzero(chance > (limits.PAIR_CANDIDATE if pairs else 0.0))
    yield from combinations((int(i) for i in likely), 2 if pairs else 1)


def _backward(test: HypothesisTest, when: str) -> Iterator[_Fit]:
    """The single faults that, present at other times, would explain most to first order."""
    explained = np.zeros(len(test.ruleset.faults))
    for i, fault in enumerate(test.ruleset.faults):
        towards = test.towards(fault)
        if towards is not None and towards[1][0] > 0.0:
            pull, information = (float(part[0]) for part in towards)
            explained[i] = max(pull, 0.0) ** 2 / information
    for i in np.argsort(-explained, kind="stable")[: limits.TRIED_AT_OTHER_TIMES]:
        outcome = test.run((test.ruleset.faults[i],)) if explained[i] > 0 else None
        if outcome is not None:
            yield _Fit((int(i),), when, outcome)
