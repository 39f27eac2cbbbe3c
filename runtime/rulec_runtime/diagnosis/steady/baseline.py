"""The baseline: what the fault-free part of a recording shows about lasting errors.

A systematic error of a sensor and an error of the calibration hardly change from one minute to the
next. Stretches without a contradiction bound them, so a later stretch is judged against these: an
offset that existed before is no fault. Errors are unknowns with a standard normal prior that drift
slowly; each healthy stretch conditions them in turn.

Source: own derivation, docs/method.md; the recursion is a Kalman filter of an Ornstein-Uhlenbeck
process.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.observe import Observed, signed, spreads


@dataclass(frozen=True)
class Baseline:
    """Mean, shape (errors,), and covariance of the lasting errors, in standard uncertainties.

    It rests on the first `count` of `points`, a list that all baselines of a recording share: one
    list each would grow with the square of the recording. `time` is that of the last point, s.
    """

    mean: Array
    covariance: Array
    points: list[int]
    count: int
    time: float

    def later(self, time: float) -> Baseline:
        """What is still known at a later time; the errors return to their prior."""
        kept = float(remembered(time - self.time))
        covariance = kept**2 * self.covariance
        covariance.flat[:: len(self.mean) + 1] += 1.0 - kept**2
        return Baseline(kept * self.mean, covariance, self.points, self.count, time)


@dataclass(frozen=True)
class Baselines:
    """Baselines in order of time, and which of them applies to each point, shape (n,).

    `points` are those that were learned from, `counts` gives the number of them behind each
    baseline. A long recording may have no `states`: they are not kept then.
    """

    states: Sequence[Baseline]
    at: np.ndarray
    points: Sequence[int] = ()
    counts: Sequence[int] = (0,)

    def count_at(self, point: int) -> int:
        """Number of points behind the baseline of a point."""
        return self.counts[int(self.at[point])]

    def learned_at(self, point: int) -> NDArray[np.intp]:
        """The points behind the baseline of a point."""
        return np.array(self.points[: self.count_at(point)], dtype=np.intp)


def nothing_learned(observed: Observed) -> Baseline:
    """The prior of the lasting errors: their uncertainties."""
    count = observed.shared.shape[1]
    return Baseline(np.zeros(count), np.eye(count), [], 0, 0.0)


def remembered(seconds: Array | float, lasting: float = limits.LASTING) -> Array:
    """Correlation of a lasting error with itself after some time, s, for a time constant, s."""
    correlation: Array = np.exp(-np.abs(seconds) / lasting)
    return correlation


def times_of(observed: Observed) -> Array:
    """Time of each point, s; all equal if the points do not follow each other."""
    time = observed.points.time
    return np.zeros(len(observed)) if time is None else time


def against(
    ruleset: Ruleset, observed: Observed, baselines: Baselines, at: np.ndarray | None = None
) -> Observed:
    """The same points relative to their baselines: flows shifted, covariances conditioned.

    `at` gives the baseline of each point if the points are not those learned from.
    """
    at = baselines.at if at is None else at
    offsets = np.zeros_like(observed.flows)
    time, lasting = times_of(observed), observed.covariance - observed.noise
    # Points last, as in memory.
    spread = np.moveaxis(lasting, 0, -1)
    for index, here in _same(at):
        state = baselines.states[index]
        kept = remembered(time[here] - state.time)
        shared = observed.shared[:, :, here]
        offsets[:, here] = kept * (state.mean @ shared)
        slopes = np.ascontiguousarray(shared.transpose(2, 0, 1))
        known = (slopes @ state.covariance @ slopes.transpose(0, 2, 1)).transpose(1, 2, 0)
        spread[:, :, here] = kept**2 * known + (1.0 - kept**2) * spread[:, :, here]
    covariance = observed.noise + lasting
    return replace(
        observed,
        offsets=offsets,
        covariance=covariance,
        residuals=observed.residuals - signed(ruleset, offsets),
        residual_u=spreads(ruleset, covariance),
        residual_systematic=spreads(ruleset, lasting),
    )


SHIFTED = ("offsets", "covariance", "residuals", "residual_u", "residual_systematic")
"""Fields that `against` changes."""


def _same(at: np.ndarray) -> Iterator[tuple[int, slice | np.ndarray]]:
    """Baselines and their points; a slice if one applies to all."""
    order = np.argsort(at, kind="stable")
    indexes, starts = np.unique(at[order], return_index=True)
    if len(indexes) == 1:
        yield int(indexes[0]), slice(None)
        return
    yield from zip(indexes.tolist(), np.split(order, starts[1:]), strict=True)
