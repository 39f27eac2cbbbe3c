"""Which fault fits: every hypothesis against the whole residual vector, with free degree.

A hypothesis is tested by undoing it. With the right degree of the right fault put into the
observers, all estimates of a flow agree within their uncertainty. The degree is found by
generalised least squares (a few Gauss-Newton steps), in the metric of the residuals' covariance, so
a residual that a fault leaves at zero counts as much as one that it moves.

Source: own derivation, see docs/method.md; generalised least squares as in any textbook.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from statistics import NormalDist

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.batches import FIRST, SECOND, points_along
from rulec_runtime.diagnosis.steady.degree_search import Outcomes, fit
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, gain_of, test_of
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit, groups_of
from rulec_runtime.diagnosis.steady.screen import beside_listed, may_fit


@dataclass(frozen=True, kw_only=True)
class Isolation:
    """Result per point, n of them, and fault.

    Attributes
    ----------
    judged, deviating : shape (n,); noise does not explain deviating points.
    misfit : shape (n,), chi-square of "no fault", with `freedom` degrees of freedom.
    degree, u : shape (faults, n).
    floor : shape (faults, n), standard uncertainty of a degree near 0; inf if the usable estimates
        cannot show the fault.
    distance : shape (faults, n), chi-square left when the fault is undone; inf if untestable.
    chance : probability of a false alarm per point.
    probability : shape (faults, n), among the hypotheses that fit; 0 for the others. All faults
        count as equally frequent, so that readings alone join stretches. If only two faults
        together explain a point, a fault has the sum over its pairs.
    pair : shape (n, 2), the most probable two faults if only two together fit, else -1; here the
        frequency of faults counts.
    """

    judged: np.ndarray = field(metadata=FIRST)
    deviating: np.ndarray = field(metadata=FIRST)
    misfit: Array = field(metadata=FIRST)
    freedom: np.ndarray = field(metadata=FIRST)
    degree: Array = field(metadata=SECOND)
    u: Array = field(metadata=SECOND)
    floor: Array = field(metadata=SECOND)
    distance: Array = field(metadata=SECOND)
    probability: Array = field(metadata=SECOND)
    pair: np.ndarray = field(metadata=FIRST)
    chance: float


POINTS_ALONG = points_along(Isolation)


def alarm_chance(looks: int) -> float:
    """Probability of a false alarm per stretch.

    Lasting errors are drawn once per recording, so short recordings share one probability; long
    ones have one per stretch.
    """
    return max(limits.ALARM_PER_RECORDING / max(looks, 1), limits.ALARM_PER_STRETCH)


def quantile(chance: float) -> float:
    """Normal quantile with this probability of being exceeded."""
    return NormalDist().inv_cdf(1.0 - chance)


def isolate(
    ruleset: Ruleset, observed: Observed, looks: int | None = None, *, singles: bool = False
) -> Isolation:
    """Judge every point on its own; points with the same usable observers together.

    `looks` is the number of stretches that share one chance of a false alarm (default: all). Faults
    that cannot fit are skipped: their degrees and distances stay unknown. With `singles` every
    single fault is tried, and no two simultaneous ones.
    """
    chance = alarm_chance(len(observed) if looks is None else looks)
    faults, n = len(ruleset.faults), len(observed)
    unknown = np.full((faults, n), np.inf)
    result = Isolation(
        judged=np.zeros(n, dtype=bool),
        deviating=np.zeros(n, dtype=bool),
        misfit=np.zeros(n),
        freedom=np.zeros(n, dtype=int),
        degree=np.zeros((faults, n)),
        u=unknown,
        floor=unknown.copy(),
        distance=unknown.copy(),
        probability=np.zeros((faults, n)),
        pair=np.full((n, 2), -1),
        chance=chance,
    )
    for test in tests_of(ruleset, observed):
        _judge_group(test, result, singles=singles)
    return result


def tests_of(ruleset: Ruleset, observed: Observed) -> Iterator[HypothesisTest]:
    """Tests of all points on their own whose estimates check each other."""
    for valid, members, _ in groups_of(ruleset, observed.valid):
        yield test_of(ruleset, observed, valid, members)


def agreement(
    ruleset: Ruleset, observed: Observed, *, beside_faults: bool = False
) -> tuple[Array, np.ndarray]:
    """Chi-square of a sound plant, or with its best single fault, and the degrees of freedom, shape
    (n,) each; infinite and 0 where nothing can be compared."""
    n = len(observed)
    chi, freedom = np.full(n, np.inf), np.zeros(n, dtype=int)
    for test in tests_of(ruleset, observed):
        found = test.metric.value
        if beside_faults:
            fits = fit(test, [(fault,) for fault in ruleset.faults])
            found = np.fmin(found, fits.distance.min(axis=0, initial=np.inf))
        chi[test.members[0]] = np.where(np.isfinite(found), found, np.inf)
        freedom[test.members[0]] = len(test.basis)
    return chi, freedom


def _judge_group(test: HypothesisTest, result: Isolation, *, singles: bool) -> None:
    members, rank = test.members[0], len(test.basis)
    chance = result.chance
    misfit = test.metric.value
    result.judged[members] = True
    result.misfit[members] = misfit
    result.freedom[members] = rank
    # Half of the chance of a false alarm goes to "anything is wrong", half to the faults that the
    # estimates can show: a test in the direction of a fault detects smaller ones.
    deviating = misfit > chi_square_limit(rank, quantile(chance / 2))
    visible = np.array([bool(test.touched((fault,))) for fault in test.ruleset.faults], dtype=bool)
    asked = visible & test.ruleset.is_listed
    strongest = quantile(chance / (2 * max(int(asked.sum()), 1)))
    pull, information = test.towards()
    with np.errstate(divide="ignore", invalid="ignore"):
        floor = np.where(information > 0, 1.0 / np.sqrt(information), np.inf)
        deviating |= (pull * floor > strongest)[asked].any(axis=0)
    result.floor[np.ix_(visible, members)] = floor[visible]
    result.deviating[members] = deviating
    if deviating.any():
        gain = gain_of(pull, information)[:, deviating]
        _explain(test.at(deviating), gain, result, singles=singles)


def _explain(test: HypothesisTest, gain: Array, result: Isolation, *, singles: bool) -> None:
    """Single faults that fit deviating points, and pairs where none does; `gain` is each one's
    decrease of chi-square to first order, (faults, n)."""
    chosen, rank, chance = test.members[0], len(test.basis), result.chance
    limit = accepted(rank, 1, chance)
    every = [(fault,) for fault in test.ruleset.faults]
    promising = beside_listed(gain, test.ruleset.is_listed, limits.GAIN_AT_FIRST)
    fits = fit(test, every, None if singles else may_fit(test, limit, promising))
    result.degree[:, chosen], result.u[:, chosen] = fits.degree[0], fits.u[0]
    result.distance[:, chosen] = fits.distance
    evidence = np.where(fits.distance <= limit, fits.evidence, -np.inf)
    in_range = _in_range(test)
    evidence[~in_range] = -np.inf
    result.probability[:, chosen] = shares(evidence)
    # A change of the liquid explains most pairs of faults too, so pairs are tried beside it.
    own = np.array([bool(fault.module) for fault in test.ruleset.faults], dtype=bool)
    unexplained = np.asarray(~np.isfinite(evidence[own]).any(axis=0) & in_range[own].all(axis=0))
    if not singles and unexplained.any() and rank > 2:
        tried, found = _fit_pairs(test.at(unexplained), accepted(rank, 2, chance))
        least = np.max(evidence[:, unexplained], axis=0, initial=-np.inf) + limits.SECOND_FAULT
        better = np.max(found.evidence, axis=0, initial=-np.inf) > least
        result.probability[:, chosen[unexplained][better]] = 0.0
        if tried:
            _take_pairs(tried, found, better, chosen[unexplained], test.ruleset.odds, result)


def _in_range(test: HypothesisTest) -> np.ndarray:
    """Whether a fault may explain every reading beyond its range, shape (faults, n).

    The equations hold in a range. A fault may move what it scales out of it; any other excursion is
    an operating point outside the model.
    """
    faults = test.ruleset.faults
    members = test.members[0]
    in_range = np.ones((len(faults), len(members)), dtype=bool)
    for signal, flags in test.observed.extrapolated.items():
        observers = zip(test.ruleset.observers, test.valid, strict=True)
        is_read = any(usable and signal in observer.signals for observer, usable in observers)
        outside = flags[members] & is_read
        in_range[[signal not in fault.scales for fault in faults]] &= ~outside
    return in_range


def _take_pairs(
    pairs: Sequence[tuple[int, int]],
    fits: Outcomes,
    better: np.ndarray,
    members: np.ndarray,
    odds: Array,
    result: Isolation,
) -> None:
    """Enter the results of pairs at `better` points: per fault the sum over its pairs, and the best
    pair's degree.

    `odds` are the prior odds of the faults, shape (faults,).
    """
    of_pair = np.array(pairs)
    probability = np.where(better, shares(fits.evidence), 0.0)
    found = np.flatnonzero(probability.max(axis=0) > 0)
    points = members[found]
    posterior = shares(fits.evidence + np.log(odds[of_pair]).sum(axis=1)[:, None])
    result.pair[points] = of_pair[np.argmax(posterior[:, found], axis=0)]
    order = np.argsort(probability[:, found], axis=0, kind="stable")
    # The most probable pair of each fault comes last and stays; of a pair, its second fault.
    for side in (0, 1):
        np.add.at(result.probability, (of_pair[:, side, None], points), probability[:, found])
        for row in order:
            fault = of_pair[row, side]
            result.degree[fault, points] = fits.degree[side, row, found]
            result.u[fault, points] = fits.u[side, row, found]


def _fit_pairs(test: HypothesisTest, limit: float) -> tuple[list[tuple[int, int]], Outcomes]:
    """Pairs of faults by their indexes, and their fits; beyond the distance `limit` the
    log-likelihood is -inf. Simultaneous faults add up to first order, so linear effects screen all
    pairs at once. Two is the maximum: each further degree reduces the evidence."""
    tried, left = _pairs_at_first(test)
    order = np.argsort(left, axis=0)[: limits.PAIRS_SCREENED]
    pairs, faults = [tried[k] for k in np.unique(order)], test.ruleset.faults
    fits = fit(test, [(faults[i], faults[j]) for i, j in pairs])
    evidence = np.where(fits.distance <= limit, fits.evidence, -np.inf)
    return pairs, fits._replace(evidence=evidence)


def _pairs_at_first(test: HypothesisTest) -> tuple[list[tuple[int, int]], Array]:
    """Pairs by their linear effects with non-negative degrees, and the distance left, shape (pairs,
    n)."""
    slope, metric = test.effects(), test.metric
    products = (slope.transpose(0, 2, 1) @ (metric.inverse @ slope)).transpose(1, 2, 0)
    pull = -np.einsum("nrf,nr->fn", slope, metric.weighted)
    size = np.einsum("ffn->fn", products)
    visible = np.flatnonzero(slope.any(axis=(0, 1)))
    pairs: list[tuple[int, int]] = []
    found: list[Array] = []
    for k, i in enumerate(visible.tolist()):
        others = visible[k + 1 :]
        cross = products[i, others]
        with np.errstate(divide="ignore", invalid="ignore"):
            determinant = size[i] * size[others] - cross**2
            a = (size[others] * pull[i] - cross * pull[others]) / determinant
            b = (size[i] * pull[others] - cross * pull[i]) / determinant
            left = metric.value - a * pull[i] - b * pull[others]
        # For effects in the same direction the determinant is only rounding, and the fit would
        # reject them: they must not take the place of a distinguishable pair.
        apart = determinant > limits.DEGREES_APART * size[i] * size[others]
        both = apart & (a > 0) & (b > 0) & np.isfinite(left)
        shown = both.any(axis=1)
        pairs += [(i, int(j)) for j in others[shown]]
        found.append(np.where(both, left, np.inf)[shown])
    return pairs, np.concatenate([*found, np.zeros((0, len(test)))])


def shares(evidence: Array) -> Array:
    """Log-likelihoods, shape (hypotheses, n), to probabilities with equal priors; 0 if none."""
    evidence = np.round(evidence, limits.EVIDENCE_DECIMALS)
    best = np.max(evidence, axis=0, initial=-np.inf)
    finite = np.isfinite(best)
    weight = np.where(finite, np.exp(evidence - np.where(finite, best, 0.0)), 0.0)
    total = weight.sum(axis=0)
    return np.asarray(weight / np.where(total > 0, total, 1.0))


def accepted(rank: int, fitted: int, chance: float) -> float:
    """Distance up to which a hypothesis fits: the rest would not raise an alarm by itself.

    With as many degrees fitted as there are residuals anything fits.
    """
    return chi_square_limit(max(rank - fitted, 1), quantile(chance))
