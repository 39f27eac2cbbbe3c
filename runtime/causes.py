"""Name the causes of a run of stretches, with what else could be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.combine import ONSET, Hypothesis, combine
from runtime.isolate import Isolation
from runtime.ruleset import Ruleset
from runtime.seen import Seen

RIVAL = 1.0 / 3.0
"""A cause at least this probable, relative to the named one, is an alternative to it."""

MENTION = 0.02
"""Causes less probable than this are not mentioned at all."""


@dataclass(frozen=True)
class Cause:
    """A named fault (index) with degree, uncertainty, probability, and when it is there.

    `rivals` and `remote` are other causes with their probabilities, `together` the faults found
    at the same time.
    """

    fault: int
    degree: float
    u: float
    probability: float
    rivals: tuple[tuple[int, float], ...]
    remote: tuple[tuple[int, float], ...]
    together: tuple[int, ...]
    when: str


def causes_of(
    ruleset: Ruleset, seen: Seen, members: Sequence[int], known: frozenset[int]
) -> list[Cause]:
    """The causes of a run: one fault, or two at once; `known` are faults found just before."""
    hypotheses = []
    if seen.combined:
        hypotheses = combine(ruleset, seen.plain, seen.baselines, seen.isolation, members, known)
    if not hypotheses:
        hypotheses = [_average(seen.isolation, members)]
    best = hypotheses[0]
    chance: dict[int, float] = {}
    for hypothesis in hypotheses:
        for fault in hypothesis.faults:
            chance[fault] = chance.get(fault, 0.0) + hypothesis.probability
    return [_cause(ruleset, best, place, chance) for place in range(len(best.faults))]


def _cause(ruleset: Ruleset, best: Hypothesis, place: int, chance: Mapping[int, float]) -> Cause:
    """One fault of the best hypothesis, and what could be in its stead.

    Faults that move all residuals in the same proportion are rivals even where assumptions (the
    tolerance of a law) favour one of them: no reading tells them apart.
    """
    fault = best.faults[place]
    twins = {
        name
        for group in ruleset.ambiguous
        if group.kind == "coincide" and ruleset.faults[fault].id in group.faults
        for name in group.faults
    }
    others = sorted(
        ((f, p) for f, p in chance.items() if f not in best.faults and p > MENTION),
        key=lambda other: -other[1],
    )
    close = [p >= RIVAL * chance[fault] or ruleset.faults[f].id in twins for f, p in others]
    return Cause(
        fault,
        best.degrees[place],
        best.u[place],
        min(chance[fault], 1.0),
        tuple(other for other, near in zip(others, close, strict=True) if near),
        tuple(other for other, near in zip(others, close, strict=True) if not near),
        tuple(f for f in best.faults if f != fault),
        best.when,
    )


def _average(isolation: Isolation, members: Sequence[int]) -> Hypothesis:
    """Where no degree fits all stretches: the mean of what each says, with their scatter."""
    pair = tuple(int(i) for i in isolation.pair[members[0]])
    mean = isolation.probability[:, members].mean(axis=1)
    faults = pair if pair[0] >= 0 else (int(np.argmax(mean)),)
    degrees, spreads = [], []
    for fault in faults:
        each, u = isolation.degree[fault, members], isolation.u[fault, members]
        weights = 1.0 / np.maximum(u, 1e-12) ** 2
        degree = float(np.sum(weights * each) / np.sum(weights))
        degrees.append(degree)
        # Lasting errors do not average out over a run, so the uncertainty is that of one stretch.
        spreads.append(float(np.hypot(np.min(u), np.sqrt(np.average((each - degree) ** 2)))))
    return Hypothesis(
        faults, tuple(degrees), tuple(spreads), float(mean[list(faults)].min()), ONSET
    )
