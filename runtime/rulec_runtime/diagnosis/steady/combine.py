"""Evidence of all stretches of a run together, beside the fault-free ones before it.

One operating point cannot distinguish a sensor's slope from a clogging where both move the same
residuals alike; several can, for the degree that fits one of them must fit all. Lasting errors are
the same in all stretches, so residuals are stacked with their joint covariance. The stack includes
the stretches behind the baseline: they may turn out to hold the fault too, or one that has gone.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.baseline import Baselines
from rulec_runtime.diagnosis.steady.contrasts import Contrasts
from rulec_runtime.diagnosis.steady.degree_search import Outcomes, fit, pair_starts
from rulec_runtime.diagnosis.steady.hypothesis import gain_of, stacked_test, test_of
from rulec_runtime.diagnosis.steady.isolate import Isolation, accepted, shares
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit, spread_evenly, thinned
from rulec_runtime.diagnosis.steady.screen import beside_listed, leading, may_fit

ONSET, THROUGHOUT, ENDED = "onset", "throughout", "ended"
"""When a fault is present: in the run only, also in the baseline, or in the baseline only."""


@dataclass(frozen=True)
class Fit:
    """Best fit of faults (indexes) to one run: when they are present, degrees and standard
    uncertainties, chi-square left, and log-likelihood.

    Among others it has a probability, and one if all faults were equally frequent (`unprejudiced`).
    """

    faults: tuple[int, ...]
    when: str
    degrees: tuple[float, ...]
    u: tuple[float, ...]
    distance: float
    evidence: float
    probability: float = 0.0
    unprejudiced: float = 0.0

    def bounds(self, fault: int) -> tuple[float, float]:
        """95 % bounds of the degree of one of the faults."""
        i = self.faults.index(fault)
        half = common.COVERAGE * self.u[i]
        return self.degrees[i] - half, self.degrees[i] + half


@dataclass(frozen=True)
class Fits:
    """All fits tried on one run, and the number of residuals of its stack."""

    tried: list[Fit]
    rank: int


@dataclass(frozen=True)
class _Stack:
    """The stacked stretches of a run and of its baseline; `run` is the number of the run."""

    run: int
    members: Sequence[int]
    learned: np.ndarray
    points: np.ndarray
    valid: np.ndarray

    @property
    def shape(self) -> tuple[bytes, int, int]:
        """Stacks of the same shape are worked out together."""
        return self.valid.tobytes(), len(self.learned), len(self.points)


def fits_of(
    ruleset: Ruleset,
    observed: Observed,
    baselines: Baselines,
    isolation: Isolation,
    runs: Sequence[Sequence[int]],
) -> list[Fits]:
    """Fit hypotheses to all stretches of each run; `observed` is not shifted by baselines."""
    alike: dict[tuple[bytes, int, int], list[_Stack]] = {}
    for run, members in enumerate(runs):
        points, valid = spread_evenly(observed.valid, members)
        learned = baselines.learned_at(members[0])
        usable = learned[observed.valid[:, learned][valid].all(axis=0)]
        stack = _Stack(run, members, thinned(usable), points, valid)
        alike.setdefault(stack.shape, []).append(stack)
    found: dict[int, Fits] = {}
    for stacks in alike.values():
        # Portions of stacks whose matrices, three of each, fit into memory.
        first = stacks[0]
        residuals = (len(first.learned) + len(first.points)) * int(first.valid.sum())
        size = max(limits.TABLE // (3 * residuals**2), 1)
        for low in range(0, len(stacks), size):
            found |= _fits_alike(ruleset, observed, isolation, stacks[low : low + size])
    return [found[run] for run in range(len(runs))]


def hypotheses_of(
    fits: Fits, chance: float, odds: Array, before: frozenset[int] = frozenset()
) -> list[Fit]:
    """Hypotheses that fit all stretches of a run, the most probable first; none if none does.

    `odds` are the prior odds of the faults, shape (faults,); `before` are faults found just before
    the run.
    """
    rank = fits.rank
    sound = [f for f in fits.tried if f.distance <= accepted(rank, len(f.faults), chance)]
    if not sound:
        return []
    evidence = np.array([f.evidence for f in sound])
    evidence += [limits.FOUND_BEFORE * bool(before & set(f.faults)) for f in sound]
    evidence += [limits.FAULT_FROM_START * (f.when != ONSET) for f in sound]
    prior = np.array([np.log(odds[list(f.faults)]).sum() for f in sound])
    chance_of, alone = (shares(e[:, None])[:, 0] for e in (evidence + prior, evidence))
    found = []
    for k in np.argsort(-chance_of, kind="stable").tolist():
        if chance_of[k] and alone[k]:
            fit, freedom, wide = sound[k], rank - len(sound[k].faults), 1.0
            # Wider bounds if stretches scatter more than they should.
            if freedom > 0 and fit.distance > chi_square_limit(freedom, limits.DISAGREE):
                wide = float(np.sqrt(fit.distance / freedom))
            u, both = tuple(wide * own for own in fit.u), (float(chance_of[k]), float(alone[k]))
            found.append(replace(fit, u=u, probability=both[0], unprejudiced=both[1]))
    return found


def _fits_alike(
    ruleset: Ruleset, observed: Observed, isolation: Isolation, stacks: Sequence[_Stack]
) -> dict[int, Fits]:
    """Fits of runs whose stacks have the same shape."""
    first, count = stacks[0], len(stacks)
    members = np.array([np.concatenate([s.learned, s.points]) for s in stacks]).T
    once = np.repeat([0.0, 1.0], [len(first.learned), len(first.points)])
    later = np.repeat(once[:, None], count, axis=1)
    test = stacked_test(ruleset, observed, first.valid, members, later)
    candidates = [set(_candidates(ruleset, isolation, s.members)) for s in stacks]
    singles: list[tuple[int, ...]] = [(i,) for i in range(len(ruleset.faults))]
    shown: Sequence[int] = range(len(singles))
    if len(test.basis) >= limits.MANY_RESIDUALS:
        basis, shown = _contrasts(ruleset, observed, isolation, stacks)
        test = test.in_basis(basis)
    asked = [[one in own for own in candidates] for one in singles]
    tried, times = [np.array(asked, dtype=bool)], [ONSET]
    if len(first.learned):
        times += [THROUGHOUT, ENDED]
        earlier = test.at_other_times(np.hstack([np.ones_like(later), 1.0 - later]))
        # The faults that would explain most to first order.
        explained = gain_of(*earlier.towards())
        tried.append(leading(explained, ruleset.is_listed) & (explained > 0.0))
        test = test.at_other_times(np.hstack([later, earlier.present]))
    limit = accepted(test.freedom, 1, isolation.chance)
    shows = np.isin(np.arange(len(singles)), [*shown])[:, None]
    fits = fit(test, [(f,) for f in ruleset.faults], may_fit(test, limit, np.hstack(tried) & shows))
    found = [
        [
            one
            for k, when in enumerate(times)
            for one in _fits_at(singles, fits, when, k * count + i)
        ]
        for i in range(count)
    ]
    pairs = sorted({c for own in candidates for c in own if len(c) > 1})
    if pairs:
        begin = _pair_starts(isolation, stacks, np.array(pairs).T)
        asked = [[one in own for own in candidates] for one in pairs]
        faults = [(ruleset.faults[i], ruleset.faults[j]) for i, j in pairs]
        fits = fit(test.at(np.arange(count)), faults, np.array(asked, dtype=bool), begin)
        for i, own in enumerate(found):
            own += _fits_at(pairs, fits, ONSET, i)
    return {s.run: Fits(own, test.freedom) for s, own in zip(stacks, found, strict=True)}


def _contrasts(
    ruleset: Ruleset, observed: Observed, isolation: Isolation, stacks: Sequence[_Stack]
) -> tuple[Array, Sequence[int]]:
    """Combinations that show the most probable faults of some runs, and these faults."""
    members = np.concatenate([s.members for s in stacks])
    chance = isolation.probability[:, members].max(axis=1)
    # Stacking faults that move hundreds of flows is expensive: only those worth mentioning.
    wide = np.array([len(fault.affects) > limits.ROWS_OF_A_FAULT for fault in ruleset.faults])
    share = np.where(wide, limits.MENTION, limits.IMPROBABLE_THROUGHOUT)
    least = share * float(chance.max(initial=0.0))
    most = [int(i) for i in np.argsort(-chance, kind="stable") if chance[i] > least[i]]
    point, valid = stacks[0].points[:1], stacks[0].valid
    one = test_of(ruleset, observed, valid, point)
    return Contrasts(one, len(stacks[0].learned) + len(stacks[0].points)).basis(most)


def _fits_at(
    hypotheses: Sequence[tuple[int, ...]], fits: Outcomes, when: str, column: int
) -> Iterator[Fit]:
    for i in np.flatnonzero(np.isfinite(fits.evidence[:, column])).tolist():
        degrees, u = (tuple(table[:, i, column].tolist()) for table in (fits.degree, fits.u))
        distance, evidence = float(fits.distance[i, column]), float(fits.evidence[i, column])
        yield Fit(hypotheses[i], when, degrees, u, distance, evidence)


def _pair_starts(isolation: Isolation, stacks: Sequence[_Stack], pairs: np.ndarray) -> Array:
    """Start degrees of pairs, shape (2, pairs), as isolated and others: (2, starts, pairs,
    runs)."""
    degrees = np.array([isolation.degree[:, s.members].mean(axis=1) for s in stacks]).T
    own, usual = degrees[pairs][:, None], pair_starts()
    return np.concatenate([own, np.broadcast_to(usual, (*usual.shape[:2], *own.shape[2:]))], axis=1)


def _candidates(
    ruleset: Ruleset, isolation: Isolation, members: Sequence[int]
) -> Iterator[tuple[int, ...]]:
    """Single faults, or pairs where only pairs fit; unlisted ones if nothing explains a stretch
    better."""
    own = isolation.probability[:, members]
    pairs = isolation.pair[members[0], 0] >= 0
    if not pairs:
        own = np.where(beside_listed(own, ruleset.is_listed, limits.AS_GOOD), own, 0.0)
    least = limits.PAIR_CANDIDATE if pairs else 0.0
    yield from combinations(np.flatnonzero(own.max(axis=1) > least).tolist(), 2 if pairs else 1)
