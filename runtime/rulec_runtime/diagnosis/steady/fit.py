"""Test hypotheses by undoing their faults: which degrees make all estimates agree best?

A hypothesis is tried on many problems at once: each has few numbers, and one call of numpy serves
all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.degree_search import Faults, Trial
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest


@dataclass(frozen=True)
class Outcomes:
    """Per hypothesis and problem: best degrees and their standard uncertainties, both of shape
    (faults, hypotheses, n), chi-square left and log-likelihood, (hypotheses, n). If a hypothesis
    touches no usable observer, or was not tried: 0, inf, inf and -inf."""

    degree: Array
    u: Array
    distance: Array
    evidence: Array

    def where(self, chosen: np.ndarray, others: Outcomes) -> Outcomes:
        """The same with other outcomes at flags, shape (hypotheses, n)."""
        pairs = [(getattr(others, f.name), getattr(self, f.name)) for f in fields(self)]
        return Outcomes(*(np.where(chosen, other, own) for other, own in pairs))


def fit(
    test: HypothesisTest,
    hypotheses: Sequence[Faults],
    tried: np.ndarray | None = None,
    starts: Array | None = None,
) -> Outcomes:
    """Fit the degrees of hypotheses, all with the same number of faults.

    Parameters
    ----------
    tried : shape (hypotheses, n), which of them to try on which problems; default all.
    starts : initial degrees, of a shape that broadcasts to (faults, starts, hypotheses, n); default
        by the faults.
    """
    shape = (len(hypotheses), len(test))
    count = len(hypotheses[0]) if hypotheses else 1
    found = Outcomes(
        np.zeros((count, *shape)),
        np.full((count, *shape), np.inf),
        np.full(shape, np.inf),
        np.full(shape, -np.inf),
    )
    begin = usual_starts(hypotheses) if starts is None else starts
    begin = np.broadcast_to(begin, (count, begin.shape[1], *shape))
    size = max(limits.TABLE // max(test.freedom**2, 1), 1)
    for i, faults in enumerate(hypotheses):
        touched = test.touched(faults)
        asked = ~np.any([_unread(test, fault) for fault in faults], axis=0)
        problems = np.flatnonzero(asked if tried is None else asked & tried[i])
        for low in range(0, len(problems) if touched else 0, size):
            at = problems[low : low + size]
            trial = Trial(test=test.at(at), faults=faults, touched=touched)
            outcome = trial.outcome(test.metric.problems(at), begin[:, :, i, at])
            found.degree[:, i, at], found.u[:, i, at] = outcome[:2]
            found.distance[i, at], found.evidence[i, at] = outcome[2:]
    return found


def _unread(test: HypothesisTest, fault: FaultSpec) -> np.ndarray:
    """Problems in which a fault would affect a reading that was removed, shape (n,)."""
    return np.asarray(np.any(test.unread(fault) & (test.present > 0.0), axis=0))


def usual_starts(hypotheses: Sequence[Faults]) -> Array:
    """Initial degrees, shape (faults, starts, hypotheses, 1)."""
    if not hypotheses or len(hypotheses[0]) == 1:
        singles = [_single(faults) for faults in hypotheses]
        most = max(map(len, singles), default=1)
        # Zero comes first, so padding with zeros changes nothing.
        padded = [np.pad(s, (0, most - len(s))) for s in singles]
        return np.array(padded).reshape(1, len(padded), most, 1).transpose(0, 2, 1, 3)
    return pair_starts()


def _single(faults: Faults) -> Array:
    """Initial degrees of one fault: zero and those in its range."""
    (fault,) = faults
    low = fault.lowest / fault.scale
    top = fault.highest * (1.0 - common.BELOW_HIGHEST) / fault.scale
    starts = np.array(limits.FIT_STARTS)
    return np.asarray(starts[(starts == 0.0) | ((low < starts) & (top > starts))] * fault.scale)


def pair_starts() -> Array:
    """Initial degrees of two faults, shape (2, starts, 1, 1)."""
    both = [(a, b) for a in limits.PAIR_STARTS for b in limits.PAIR_STARTS]
    return np.array(both).T[:, :, None, None]
