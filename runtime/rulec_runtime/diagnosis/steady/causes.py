"""Name the causes of a run of stretches, with the alternatives."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.combine import ONSET, Fit, Fits, hypotheses_of
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints
from rulec_runtime.diagnosis.steady.isolate import Isolation
from rulec_runtime.diagnosis.steady.rivals import Other, rivals_of


@dataclass(frozen=True)
class Cause:
    """A named fault (index) with degree, 95 % bounds, probability, and when it is present.

    The bounds cover the degrees in all plausible hypotheses. `rivals` and `remote` are other causes
    with their probabilities, see `rivals_of`, `together` the faults found at the same time.
    """

    fault: int
    degree: float
    lower: float
    upper: float
    probability: float
    rivals: tuple[tuple[int, float], ...]
    remote: tuple[tuple[int, float], ...]
    together: tuple[int, ...]
    when: str


def causes_of(
    evaluated: EvaluatedPoints, members: Sequence[int], fits: Fits, known: frozenset[int]
) -> list[Cause]:
    """The causes of a run by its fits: one fault, or two; `known` are faults found just before."""
    ruleset = evaluated.part.ruleset
    hypotheses = hypotheses_of(fits, evaluated.isolation.chance, ruleset.odds, known)
    if not hypotheses:
        hypotheses = [_average(evaluated.isolation, members, ruleset.odds)]
    fitting = evaluated.isolation.probability[:, members].max(axis=1) > 0.0
    best = _named(ruleset, hypotheses)
    return [_cause(ruleset, hypotheses, best, fault, fitting) for fault in best.faults]


def _named(ruleset: Ruleset, hypotheses: Sequence[Fit]) -> Fit:
    """The most probable hypothesis; of indistinguishable ones, the most frequent."""
    first = hypotheses[0]
    groups = {frozenset(_twins(ruleset, f)) for f in first.faults}
    alike = [
        h
        for h in hypotheses
        if h.when == first.when
        and len(h.faults) == len(first.faults)
        and {frozenset(_twins(ruleset, f)) for f in h.faults} == groups
    ]
    return max(alike, key=lambda h: float(np.prod(ruleset.odds[list(h.faults)])))


def _cause(
    ruleset: Ruleset,
    hypotheses: Sequence[Fit],
    best: Fit,
    fault: int,
    fitting: np.ndarray,
) -> Cause:
    """One fault of the named hypothesis, and its alternatives.

    `fitting` flags the faults that fit some stretch of the run, shape (faults,).
    """
    own = [h for h in hypotheses if fault in h.faults]
    plausible = [h for h in own if h.probability >= limits.RIVAL * best.probability]
    spans = [h.bounds(fault) for h in plausible]
    found = _others(hypotheses, best, fault, lambda h: h.probability)
    alone = _others(hypotheses, best, fault, lambda h: h.unprejudiced)
    found[fault] = sum(h.probability for h in own)
    alone[fault] = sum(h.unprejudiced for h in own)
    twins = {t for t in _twins(ruleset, fault) if t != fault and (t in found or fitting[t])}
    if twins:
        # No reading distinguishes them: whatever else favours one of them is an assumption. Twins
        # that only some stretches allow must not outrank those that all stretches do.
        group = [fault, *sorted(twins)]
        odds = np.minimum(ruleset.odds[group], ruleset.odds[fault])
        found |= _shared(found, group, odds)
        alone |= _shared(alone, group, np.ones(len(group)))
    named = Other(fault, found.pop(fault), alone[fault])
    others = [Other(f, p, alone[f], ruleset.faults[f].unlisted) for f, p in found.items()]
    rivals, remote = rivals_of(named, others)
    return Cause(
        fault,
        best.degrees[best.faults.index(fault)],
        min(low for low, _ in spans),
        max(high for _, high in spans),
        min(named.probability, 1.0),
        rivals,
        remote,
        tuple(f for f in best.faults if f != fault),
        best.when,
    )


def _shared(chance: dict[int, float], group: Sequence[int], odds: np.ndarray) -> dict[int, float]:
    """Probability of a group of faults together, shared in proportion to their odds."""
    total = sum(chance.get(f, 0.0) for f in group)
    return dict(zip(group, (total * odds / odds.sum()).tolist(), strict=True))


def _others(
    hypotheses: Sequence[Fit],
    best: Fit,
    fault: int,
    probability: Callable[[Fit], float],
) -> dict[int, float]:
    """Faults that replace a fault in the other hypotheses, with their probabilities."""
    chance: dict[int, float] = {}
    for hypothesis in hypotheses:
        if fault not in hypothesis.faults:
            for other in set(hypothesis.faults) - set(best.faults):
                chance[other] = chance.get(other, 0.0) + probability(hypothesis)
    return chance


def _twins(ruleset: Ruleset, fault: int) -> frozenset[int]:
    """Faults that move all residuals in the same proportion, the fault itself among them."""
    if "twins" not in ruleset.kept:
        place = {f.id: i for i, f in enumerate(ruleset.faults)}
        twins = [{i} for i in range(len(place))]
        for group in ruleset.ambiguous:
            if group.kind == "coincide":
                members = {place[name] for name in group.faults if name in place}
                for one in members:
                    twins[one] |= members
        ruleset.kept["twins"] = [frozenset(own) for own in twins]
    found: frozenset[int] = ruleset.kept["twins"][fault]
    return found


def _average(isolation: Isolation, members: Sequence[int], odds: Array) -> Fit:
    """Where no degree fits all stretches: the mean of those of each, with their scatter."""
    pair = tuple(int(i) for i in isolation.pair[members[0]])
    mean = isolation.probability[:, members].mean(axis=1)
    weighed = mean * odds
    faults = pair if pair[0] >= 0 else (int(np.argmax(weighed)),)
    weighed *= mean.sum() / weighed.sum()
    degrees, spreads = [], []
    for fault in faults:
        each, u = isolation.degree[fault, members], isolation.u[fault, members]
        weights = 1.0 / np.maximum(u, common.LEAST_U) ** 2
        degree = float(np.sum(weights * each) / np.sum(weights))
        degrees.append(degree)
        # Lasting errors do not average out over a run, so the uncertainty is that of one stretch.
        spreads.append(float(np.hypot(np.min(u), np.sqrt(np.average((each - degree) ** 2)))))
    probability, unprejudiced = (float(p[list(faults)].min()) for p in (weighed, mean))
    nothing = np.nan, np.nan
    of_each = tuple(degrees), tuple(spreads)
    return Fit(faults, ONSET, *of_each, *nothing, probability, unprejudiced)
