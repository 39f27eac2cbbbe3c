"""Name the causes of a run of stretches, with what else could be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.combine import ONSET, Fits, Hypothesis, fits_of, hypotheses_of
from rulec_runtime.diagnosis.steady.isolate import Isolation
from rulec_runtime.diagnosis.steady.seen import Seen


@dataclass(frozen=True)
class Cause:
    """A named fault (index) with degree, 95 % bounds, probability, and when it is there.

    The bounds hold the degrees that it has in all plausible hypotheses.
    `rivals` and `remote` are other causes with their probabilities, `together` the faults found
    at the same time.
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


def fits_of_runs(seen: Seen, runs: Sequence[Sequence[int]]) -> list[Fits]:
    """What fits each run; nothing is tried where points are not combined."""
    if not seen.combined:
        return [Fits([], 0) for _ in runs]
    return fits_of(seen.part.ruleset, seen.plain, seen.baselines, seen.isolation, runs)


def causes_of(seen: Seen, members: Sequence[int], fits: Fits, known: frozenset[int]) -> list[Cause]:
    """The causes of a run by what fits it: one fault, or two at once; `known` are faults found just
    before."""
    hypotheses = hypotheses_of(fits, seen.isolation.chance, known)
    if not hypotheses:
        hypotheses = [_average(seen.isolation, members)]
    fitting = seen.isolation.probability[:, members].max(axis=1) > 0.0
    places = range(len(hypotheses[0].faults))
    return [_cause(seen.part.ruleset, hypotheses, place, fitting) for place in places]


def _cause(
    ruleset: Ruleset, hypotheses: Sequence[Hypothesis], place: int, fitting: np.ndarray
) -> Cause:
    """One fault of the best hypothesis, and what could be in its stead.

    `fitting` flags the faults that fit some stretch of the run, shape (faults,).
    """
    best = hypotheses[0]
    fault = best.faults[place]
    own = [h for h in hypotheses if fault in h.faults]
    plausible = [h for h in own if h.probability >= limits.RIVAL * best.probability]
    spans = [h.bounds(fault) for h in plausible]
    chance = sum(h.probability for h in own)
    found = _others(hypotheses, best, fault)
    twins = {t for t in _twins(ruleset, fault) if t != fault and (t in found or fitting[t])}
    if twins:
        # No reading tells them apart: whatever favours one of them is an assumption.
        chance = (chance + sum(found.get(t, 0.0) for t in twins)) / (1 + len(twins))
        found |= dict.fromkeys(sorted(twins), chance)
    others = sorted((o for o in found.items() if o[1] > limits.MENTION), key=lambda o: -o[1])
    rivals = tuple(o for o in others if o[1] >= limits.RIVAL * chance)
    return Cause(
        fault,
        best.degrees[place],
        min(low for low, _ in spans),
        max(high for _, high in spans),
        min(chance, 1.0),
        rivals,
        tuple(o for o in others if o not in rivals),
        tuple(f for f in best.faults if f != fault),
        best.when,
    )


def _others(hypotheses: Sequence[Hypothesis], best: Hypothesis, fault: int) -> dict[int, float]:
    """What stands in a fault's stead in the other hypotheses, with its probability."""
    chance: dict[int, float] = {}
    for hypothesis in hypotheses:
        if fault not in hypothesis.faults:
            for other in set(hypothesis.faults) - set(best.faults):
                chance[other] = chance.get(other, 0.0) + hypothesis.probability
    return chance


def _twins(ruleset: Ruleset, fault: int) -> frozenset[int]:
    """Faults that move all residuals in the same proportion, the fault itself among them."""
    name = ruleset.faults[fault].id
    groups = [g.faults for g in ruleset.ambiguous if g.kind == "coincide" and name in g.faults]
    return frozenset(i for i, f in enumerate(ruleset.faults) if any(f.id in g for g in groups))


def _average(isolation: Isolation, members: Sequence[int]) -> Hypothesis:
    """Where no degree fits all stretches: the mean of what each says, with their scatter."""
    pair = tuple(int(i) for i in isolation.pair[members[0]])
    mean = isolation.probability[:, members].mean(axis=1)
    faults = pair if pair[0] >= 0 else (int(np.argmax(mean)),)
    degrees, spreads = [], []
    for fault in faults:
        each, u = isolation.degree[fault, members], isolation.u[fault, members]
        weights = 1.0 / np.maximum(u, limits.LEAST_U) ** 2
        degree = float(np.sum(weights * each) / np.sum(weights))
        degrees.append(degree)
        # Lasting errors do not average out over a run, so the uncertainty is that of one stretch.
        spreads.append(float(np.hypot(np.min(u), np.sqrt(np.average((each - degree) ** 2)))))
    return Hypothesis(
        faults, tuple(degrees), tuple(spreads), float(mean[list(faults)].min()), ONSET
    )
