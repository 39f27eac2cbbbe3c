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
from rulec_runtime.diagnosis.steady.redundancy import (
    chi_square_limit,
    covariance_of,
    patterns_of,
    residual_basis,
)
from rulec_runtime.diagnosis.steady.signed_sums import signed, spreads


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
        drifted = (1.0 - kept**2) * np.eye(len(self.mean))
        covariance = kept**2 * self.covariance + drifted
        return replace(self, mean=kept * self.mean, covariance=covariance, time=time)


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


def learn(ruleset: Ruleset, observed: Observed) -> Baselines:
    """Go through the points in order of time and learn from those that nothing contradicts."""
    states = [nothing_learned(observed)]
    at = np.zeros(len(observed), dtype=int)
    time = times_of(observed)
    outside = np.any([*observed.extrapolated.values(), np.zeros(len(observed), bool)], axis=0)
    for said in _in_order(ruleset, observed):
        at[said.point] = len(states) - 1
        if not outside[said.point]:
            updated = _update(states[-1].later(time[said.point]), said)
            if updated is not None:
                states.append(updated)
    return Baselines(tuple(states), _filled(at))


@dataclass(frozen=True)
class _Said:
    """What a judgeable point says: residuals (rank,), their gradients by the lasting errors
    (rank, errors), covariance of the noise (rank, rank) and the logarithm of its determinant."""

    point: int
    residuals: Array
    shared: Array
    noise: Array
    log_determinant: float


def _in_order(ruleset: Ruleset, observed: Observed) -> list[_Said]:
    """What the judgeable points say, in order of time."""
    found: list[_Said] = []
    for valid, members in patterns_of(observed.valid):
        basis = residual_basis(ruleset, valid)
        if len(basis):
            found += _said(observed, valid, basis, members)
    return sorted(found, key=lambda said: said.point)


def _said(
    observed: Observed, valid: np.ndarray, basis: Array, members: np.ndarray
) -> Iterator[_Said]:
    """What points say that share their valid observers, all worked out together."""
    noise = np.ascontiguousarray(covariance_of(basis, observed.noise, valid, members))
    residuals = (basis @ observed.flows[valid][:, members]).T
    shared = np.tensordot(basis, observed.shared[valid][:, :, members], axes=1)
    shared = np.ascontiguousarray(np.moveaxis(shared, -1, 0))
    _, size = np.linalg.slogdet(noise)
    for k, point in enumerate(members.tolist()):
        yield _Said(point, residuals[k], shared[k], noise[k], float(size[k]))


def _update(before: Baseline, said: _Said) -> Baseline | None:
    """Condition on a point; None if it deviates, or adds next to nothing."""
    residuals, shared = said.residuals, said.shared
    if not (np.isfinite(residuals).all() and np.isfinite(shared).all()):
        return None
    crossed = before.covariance @ shared.T
    total = said.noise + shared @ crossed
    off = residuals - shared @ before.mean
    try:
        solved = np.linalg.solve(total, np.column_stack([off, crossed.T]))
    except np.linalg.LinAlgError:  # readings so far off that their errors drown in rounding
        return None
    if off @ solved[:, 0] > chi_square_limit(len(off), limits.CALM):
        return None
    gain = np.linalg.slogdet(total)[1] - said.log_determinant
    if gain < limits.WORTH_LEARNING * len(off):
        return None
    covariance = before.covariance - crossed @ solved[:, 1:]
    before.points.append(said.point)
    return replace(
        before,
        mean=before.mean + crossed @ solved[:, 0],
        covariance=0.5 * (covariance + covariance.T),
        count=before.count + 1,
    )


def times_of(observed: Observed) -> Array:
    """Time of each point, s; all the same where the points do not follow each other."""
    time = observed.points.time
    return np.zeros(len(observed)) if time is None else time


def _filled(at: np.ndarray) -> np.ndarray:
    """Points that could not be judged take the baseline of the point before."""
    filled: np.ndarray = np.maximum.accumulate(at)
    return filled


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
        residuals=observed.residuals - signed(ruleset, offsets),
        residual_u=spreads(ruleset, covariance),
        residual_systematic=spreads(ruleset, lasting),
    )


def _same(at: np.ndarray) -> Iterator[tuple[int, slice | np.ndarray]]:
    """Baselines and the points that they hold for; all points at once where one holds for all."""
    order = np.argsort(at, kind="stable")
    indexes, starts = np.unique(at[order], return_index=True)
    if len(indexes) == 1:
        yield int(indexes[0]), slice(None)
        return
    yield from zip(indexes.tolist(), np.split(order, starts[1:]), strict=True)
