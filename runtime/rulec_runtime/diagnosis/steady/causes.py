"""Name the causes of a run of stretches, with the alternatives.

A cause that the readings cannot distinguish is a rival, however rare; so is one that is about as
probable. Unlisted errors are many, and each explains something a little worse: such a one is a
rival only if no reading contradicts it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.combine import ONSET, Fit, Fits, hypotheses_of
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints
from rulec_runtime.diagnosis.steady.isolate import Isolation

Name = TypeVar("Name", int, str)


@dataclass(frozen=True)
class Other(Generic[Name]):
    """A cause with its probability, and with that if all faults were equally frequent; `unlisted`
    if its module does not list it."""

    name: Name
    probability: float
    unprejudiced: float
    unlisted: bool = False


def rivals_of(
    named: Other[Name], others: Iterable[Other[Name]]
) -> tuple[tuple[tuple[Name, float], ...], tuple[tuple[Name, float], ...]]:
    """Rivals of a cause, and remote ones, each with its probability, the most probable first."""
    rivals: list[tuple[Name, float]] = []
    remote: list[tuple[Name, float]] = []
    for other in sorted(others, key=lambda o: -o.probability):
        share = limits.ALIKE if other.unlisted else limits.RIVAL
        stands = (
            other.probability >= limits.RIVAL * named.probability
            or other.unprejudiced >= share * named.unprejudiced
        )
        chances = (other.probability, 0.0 if other.unlisted and not stands else other.unprejudiced)
        if max(chances) > limits.MENTION:
            (rivals if stands else remote).append((other.name, other.probability))
    return tuple(rivals), tuple(remote)


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
    evaluated: EvaluatedPoints, members: Sequence[int], fits: Fits, before: frozenset[int]
) -> list[Cause]:
    """The causes of a run by its fits: one fault, or two; `before` are faults found just before."""
    ruleset, isolation = evaluated.part.ruleset, evaluated.isolation
    hypotheses = hypotheses_of(fits, isolation.chance, ruleset.odds, before)
    if not hypotheses:
        hypotheses = _averages(isolation, members, ruleset.odds)
    fitting = isolation.probability[:, members].max(axis=1) > 0.0
    # The most probable hypothesis; of indistinguishable ones, the most frequent.
    first = hypotheses[0]
    alike = [h for h in hypotheses if h.when == first.when and _same(ruleset, h, first)]
    best = max(alike, key=lambda h: float(np.prod(ruleset.odds[list(h.faults)])))
    return [_cause(ruleset, hypotheses, best, fault, fitting) for fault in best.faults]


def _same(ruleset: Ruleset, one: Fit, other: Fit) -> bool:
    """Whether no reading distinguishes two hypotheses."""
    groups = [{_coinciding(ruleset, fault) for fault in fit.faults} for fit in (one, other)]
    return len(one.faults) == len(other.faults) and groups[0] == groups[1]


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
    # Faults that replace it in the other hypotheses, with their probabilities.
    found = {fault: sum(h.probability for h in own)}
    alone = {fault: sum(h.unprejudiced for h in own)}
    for one in (h for h in hypotheses if fault not in h.faults):
        for other in set(one.faults) - set(best.faults):
            found[other] = found.get(other, 0.0) + one.probability
            alone[other] = alone.get(other, 0.0) + one.unprejudiced
    equals = {t for t in _coinciding(ruleset, fault) if t != fault and (t in found or fitting[t])}
    if equals:
        # No reading distinguishes them: whatever else favours one of them is an assumption. Those
        # that only some stretches allow must not outrank those that all stretches do.
        group = [fault, *sorted(equals)]
        odds = np.minimum(ruleset.odds[group], ruleset.odds[fault])
        for chance, weights in ((found, odds), (alone, np.ones(len(group)))):
            total = sum(chance.get(f, 0.0) for f in group)
            chance |= zip(group, (total * weights / weights.sum()).tolist(), strict=True)
    named = Other(fault, found.pop(fault), alone[fault])
    others = [Other(f, p, alone[f], ruleset.faults[f].unlisted) for f, p in found.items()]
    return Cause(
        fault,
        best.degrees[best.faults.index(fault)],
        min(low for low, _ in spans),
        max(high for _, high in spans),
        min(named.probability, 1.0),
        *rivals_of(named, others),
        tuple(f for f in best.faults if f != fault),
        best.when,
    )


def _coinciding(ruleset: Ruleset, fault: int) -> frozenset[int]:
    """Faults that move all residuals in the same proportion, the fault itself among them."""
    if "coinciding" not in ruleset.cache:
        index = {f.id: i for i, f in enumerate(ruleset.faults)}
        groups = [{i} for i in range(len(index))]
        for group in ruleset.ambiguous:
            if group.kind == "coincide":
                members = {index[name] for name in group.faults if name in index}
                for one in members:
                    groups[one] |= members
        ruleset.cache["coinciding"] = [frozenset(own) for own in groups]
    found: frozenset[int] = ruleset.cache["coinciding"][fault]
    return found


def _averages(isolation: Isolation, members: Sequence[int], odds: Array) -> list[Fit]:
    """Where no degree fits all stretches: the mean of those of each, with their scatter; the most
    probable first."""
    pair = tuple(int(i) for i in isolation.pair[members[0]])
    mean = isolation.probability[:, members].mean(axis=1)
    weighed = mean * odds
    weighed *= mean.sum() / weighed.sum()
    order = np.argsort(-weighed, kind="stable").tolist()
    each = [pair] if pair[0] >= 0 else [(i,) for i in order if weighed[i] > 0.0]
    return [_average(isolation, members, faults, (weighed, mean)) for faults in each]


def _average(
    isolation: Isolation, members: Sequence[int], faults: tuple[int, ...], chances: Sequence[Array]
) -> Fit:
    """The mean of one or two faults over some stretches, with their probability and that if all
    were equally frequent."""
    degrees, spreads = [], []
    for fault in faults:
        each, u = isolation.degree[fault, members], isolation.u[fault, members]
        degrees.append(float(np.average(each, weights=1.0 / np.maximum(u, common.LEAST_U) ** 2)))
        # Lasting errors do not average out over a run, so the uncertainty is that of one stretch.
        scatter = np.sqrt(np.average((each - degrees[-1]) ** 2))
        spreads.append(float(np.hypot(np.min(u), scatter)))
    both = (float(p[list(faults)].min()) for p in chances)
    return Fit(faults, ONSET, tuple(degrees), tuple(spreads), np.nan, np.nan, *both)
