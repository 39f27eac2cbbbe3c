"""The baseline: what the fault-free part of a recording says of errors that last.

A systematic error of a sensor and an error of the calibration hardly change from one minute to
the next. Stretches in which nothing contradicts bound them, so a later stretch is judged against
these: what was off by the same amount before is no fault. Errors are unknowns with a standard
normal prior that drift slowly; each healthy stretch conditions them in turn.

Source: own derivation, docs/method.md; the recursion is a Kalman filter of an Ornstein-Uhlenbeck
process.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.observe import Observed


@dataclass(frozen=True)
class Baseline:
    """Mean, shape (errors,), and covariance of the lasting errors, in standard uncertainties.

    It rests on the first `count` of `points`, a list that all baselines of a recording share: a
    list for each would grow with the square of the recording. `time` is that of the last, s.
    """

    mean: Array
    covariance: Array
    points: list[int]
    count: int
    time: float

    @property
    def learned(self) -> tuple[int, ...]:
        """The points it rests on."""
        return tuple(self.points[: self.count])

    def later(self, time: float) -> Baseline:
        """What is still known at a later time: the rest of the errors is as before anything."""
        kept = float(remembered(time - self.time))
        covariance = kept**2 * self.covariance
        covariance.flat[:: len(self.mean) + 1] += 1.0 - kept**2
        return Baseline(kept * self.mean, covariance, self.points, self.count, time)


@dataclass(frozen=True)
class Baselines:
    """Baselines in order of time, and which of them holds at each point, shape (n,)."""

    states: tuple[Baseline, ...]
    at: np.ndarray


def nothing_learned(observed: Observed) -> Baseline:
    """What is known of the lasting errors without any fault-free stretch: their uncertainties."""
    count = observed.shared.shape[1]
    return Baseline(np.zeros(count), np.eye(count), [], 0, 0.0)


def remembered(seconds: Array | float) -> Array:
    """Correlation of a lasting error with itself after some time."""
    correlation: Array = np.exp(-np.abs(seconds) / limits.LASTING)
    return correlation


def times_of(observed: Observed) -> Array:
    """Time of each point, s; all the same where the points do not follow each other."""
    time = observed.points.time
    return np.zeros(len(observed)) if time is None else time


def against(
    ruleset: Ruleset, observed: Observed, baselines: Baselines, at: np.ndarray | None = None
) -> Observed:
    """The same points seen against their baselines: flows shifted, covariances conditioned.

    `at` gives the baseline of each point where the points are not those that were learned from.
    """
    at = baselines.at if at is None else at
    offsets = np.zeros_like(observed.flows)
    time, lasting = times_of(observed), observed.covariance - observed.noise
    # Points last, as they lie in memory.
    spread = np.moveaxis(lasting, 0, -1)
    for index, here in _same(at):
        state = baselines.states[index]
        kept = remembered(time[here] - state.time)
        shared = observed.shared[:, :, here]
        offsets[:, here] = kept * (state.mean @ shared)
        known = np.einsum("omn,pmn->opn", shared, state.covariance @ shared)
        spread[:, :, here] = kept**2 * known + (1.0 - kept**2) * spread[:, :, here]
    covariance = observed.noise + lasting
    return replace(
        observed,
        offsets=offsets,
        covariance=covariance,
        residuals=observed.residuals - _signed(ruleset, offsets),
        residual_u=_spreads(ruleset, covariance),
        residual_systematic=_spreads(ruleset, lasting),
    )


def _same(at: np.ndarray) -> Iterator[tuple[int, slice | np.ndarray]]:
    """Baselines and the points that they hold for; all points at once where one holds for all."""
    order = np.argsort(at, kind="stable")
    indexes, starts = np.unique(at[order], return_index=True)
    if len(indexes) == 1:
        yield int(indexes[0]), slice(None)
        return
    yield from zip(indexes.tolist(), np.split(order, starts[1:]), strict=True)


def _signed(ruleset: Ruleset, offsets: Array) -> Array:
    """Offsets of the residuals, shape (residuals, n)."""
    row = ruleset.observer_index
    sums = [sum(t.sign * offsets[row[t.observer]] for t in r.terms) for r in ruleset.residuals]
    return np.array(sums).reshape(-1, offsets.shape[1])


def _spreads(ruleset: Ruleset, covariance: Array) -> Array:
    """Standard uncertainties of the residuals, shape (residuals, n)."""
    row = ruleset.observer_index
    points_last = np.moveaxis(covariance, 0, -1)
    result = np.zeros((len(ruleset.residuals), len(covariance)))
    for i, residual in enumerate(ruleset.residuals):
        places = [row[t.observer] for t in residual.terms]
        signs = np.array([float(t.sign) for t in residual.terms])
        own = points_last[np.ix_(places, places)]
        variance = np.einsum("i,ijn,j->n", signs, own, signs)
        result[i] = np.sqrt(np.maximum(variance, 0.0))
    return result
