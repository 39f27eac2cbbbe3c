"""Test hypotheses by undoing their faults: which degrees make all estimates agree best?

Many hypotheses are tried on many problems at once, a column each: the numbers of one are few, and
what a call of numpy costs is spent once for all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.columns import Columns
from rulec_runtime.diagnosis.steady.fault_inversion import Faults
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest
from rulec_runtime.diagnosis.steady.starts import usual_starts


@dataclass(frozen=True)
class Outcomes:
    """Per hypothesis and problem: best degrees and their standard uncertainties, both of shape
    (faults, hypotheses, n), chi-square left and log-likelihood, (hypotheses, n). Where a hypothesis
    touches no usable observer, or was not tried: 0, inf, inf and -inf."""

    degree: Array
    u: Array
    distance: Array
    evidence: Array


def fit(
    test: HypothesisTest,
    hypotheses: Sequence[Faults],
    tried: np.ndarray | None = None,
    starts: Array | None = None,
) -> Outcomes:
    """Fit the degrees of hypotheses, all with the same number of faults.

    Parameters
    ----------
    tried : shape (hypotheses, n), which of them to try on which problems; all if not given.
    starts : degrees to begin with, of a shape that broadcasts to (faults, starts, hypotheses, n);
        without them those that suit the faults.
    """
    shape = (len(hypotheses), len(test))
    count = len(hypotheses[0]) if hypotheses else 1
    found = Outcomes(
        np.zeros((count, *shape)),
        np.full((count, *shape), np.inf),
        np.full(shape, np.inf),
        np.full(shape, -np.inf),
    )
    shown = np.array([bool(test.touched(faults)) for faults in hypotheses], dtype=bool)
    wanted = np.broadcast_to(shown[:, None], shape)
    which, problem = np.nonzero(wanted if tried is None else wanted & tried)
    begin = starts if starts is not None else usual_starts(hypotheses)
    for part in _portions(test, len(which)):
        own, at = which[part], problem[part]
        columns = Columns(test=test.at(at), hypotheses=hypotheses, which=own)
        pure = test.metric.problems(at)
        first = np.broadcast_to(begin, (count, begin.shape[1], *shape))[:, :, own, at]
        degree, u, distance, evidence = columns.outcome(pure, first)
        found.degree[:, own, at], found.u[:, own, at] = degree, u
        found.distance[own, at], found.evidence[own, at] = distance, evidence
    return found


def _portions(test: HypothesisTest, columns: int) -> Iterator[slice]:
    """Columns in portions whose matrices do not take much memory."""
    size = max(limits.TABLE // max(test.freedom**2, 1), 1)
    for low in range(0, columns, size):
        yield slice(low, low + size)
