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

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.observe import Observed, signed, spreads
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit, covariance_of, groups_of


@dataclass(frozen=True)
class Baseline:
    """Mean, shape (errors,), and covariance of the lasting errors, in standard uncertainties, at a
    time, s."""

    mean: Array
    covariance: Array
    time: float

    def later(self, time: float) -> Baseline:
        """What is still known at a later time; the errors return to their prior."""
        share = float(remembered(time - self.time))
        covariance = share**2 * self.covariance
        covariance.flat[:: len(self.mean) + 1] += 1.0 - share**2
        return Baseline(share * self.mean, covariance, time)


@dataclass(frozen=True)
class Baselines:
    """The points that were learned from, in order of time, and the baselines behind none, one, two
    of them, and so on. A long recording may have no `states`: they are not kept then."""

    learned: NDArray[np.intp]
    states: Sequence[Baseline] = ()

    def learned_at(self, point: int) -> NDArray[np.intp]:
        """The points behind the baseline of a point."""
        return self.learned[: np.searchsorted(self.learned, point)]


def nothing_learned(observed: Observed) -> Baselines:
    """The prior of the lasting errors: their uncertainties."""
    count = observed.shared.shape[1]
    return Baselines(np.zeros(0, dtype=np.intp), [Baseline(np.zeros(count), np.eye(count), 0.0)])


def remembered(seconds: Array | float, lasting: float = limits.LASTING) -> Array:
    """Correlation of a lasting error with itself after some time, s, for a time constant, s."""
    correlation: Array = np.exp(-np.abs(seconds) / lasting)
    return correlation


def times_of(observed: Observed) -> Array:
    """Time of each point, s; all equal if the points do not follow each other."""
    time = observed.points.time
    return np.zeros(len(observed)) if time is None else time


class Learner:
    """Conditions on points in order of time, which come in batches; all baselines are kept if
    `keep`."""

    def __init__(self, ruleset: Ruleset, *, keep: bool) -> None:
        self._ruleset, self._keep = ruleset, keep
        self._learned: list[int] = []
        self._states: list[Baseline] = []

    def take(self, observed: Observed, first: int) -> Baselines:
        """Learn from a batch that begins with point `first`; its own baselines."""
        states, learned = [*(self._states or nothing_learned(observed).states)][-1:], list[int]()
        groups = _groups_by(self._ruleset, observed)
        members = {int(p): (group, i) for group in groups for i, p in enumerate(group.points)}
        for point, (group, index) in sorted(members.items(), key=lambda item: item[0]):
            taken = group.taken_up(states[-1], index)
            if taken is not None:
                states.append(taken)
                learned.append(point)
        self._learned += [first + point for point in learned]
        self._states = self._states[:-1] + states if self._keep else states[-1:]
        return Baselines(np.array(learned, dtype=np.intp), states)

    def baselines(self) -> Baselines:
        """All baselines learned."""
        learned = np.array(self._learned, dtype=np.intp)
        return Baselines(learned, self._states if self._keep else ())


@dataclass(frozen=True)
class _Group:
    """Judgeable points that share their valid observers, in order of time, m of them.

    Residuals (m, rank), their gradients by the lasting errors (m, rank, errors), covariance of the
    noise (m, rank, rank) and the logarithm of its determinant (m,); `sound` points, (m,), are
    finite and within the calibrated range.
    """

    points: np.ndarray
    time: Array
    residuals: Array
    shared: Array
    noise: Array
    log_determinant: Array
    sound: np.ndarray

    def taken_up(self, before: Baseline, index: int) -> Baseline | None:
        """Condition on a point; None if it is unsound, deviates, or adds next to nothing."""
        if not self.sound[index]:
            return None
        before = before.later(float(self.time[index]))
        residuals, shared = self.residuals[index], self.shared[index]
        crossed = before.covariance @ shared.T
        total = self.noise[index] + shared @ crossed
        off = residuals - shared @ before.mean
        try:
            solved = np.linalg.solve(total, np.column_stack([off, crossed.T]))
        except np.linalg.LinAlgError:  # readings so far off that rounding hides their errors
            return None
        if off @ solved[:, 0] > chi_square_limit(len(off), common.CALM):
            return None
        gain = np.linalg.slogdet(total)[1] - self.log_determinant[index]
        if gain < limits.WORTH_LEARNING * len(off):
            return None
        covariance = before.covariance - crossed @ solved[:, 1:]
        mean = before.mean + crossed @ solved[:, 0]
        return replace(before, mean=mean, covariance=0.5 * (covariance + covariance.T))


def _groups_by(ruleset: Ruleset, observed: Observed) -> Iterator[_Group]:
    time = times_of(observed)
    outside = np.any([*observed.extrapolated.values(), np.zeros(len(observed), bool)], axis=0)
    for valid, members, basis in groups_of(ruleset, observed.valid):
        noise = np.ascontiguousarray(covariance_of(basis, observed.noise, valid, members))
        residuals = (basis @ observed.flows[valid][:, members]).T
        shared = np.tensordot(basis, observed.shared[valid][:, :, members], axes=1)
        shared = np.ascontiguousarray(np.moveaxis(shared, -1, 0))
        sound = np.isfinite(residuals).all(axis=1) & np.isfinite(shared).all(axis=(1, 2))
        size = np.linalg.slogdet(noise)[1]
        calm = sound & ~outside[members]
        yield _Group(members, time[members], residuals, shared, noise, size, calm)


SHIFTED = ("offsets", "residuals", "residual_u", "residual_systematic", "u")
"""What `against` changes for good: covariances are not kept."""


def against(
    ruleset: Ruleset, observed: Observed, baselines: Baselines, points: np.ndarray
) -> Observed:
    """Points relative to their baselines: flows shifted, covariances conditioned. `points` are the
    same ones, or those that share their baselines, by their indexes among those learned from."""
    offsets = np.zeros_like(observed.flows)
    time, lasting = times_of(observed), observed.covariance - observed.noise
    # Points last, as in memory.
    spread = np.moveaxis(lasting, 0, -1)
    at = np.searchsorted(baselines.learned, points)
    for index in np.unique(at).tolist():
        here = slice(None) if len(baselines.states) == 1 else np.flatnonzero(at == index)
        state = baselines.states[index]
        share = remembered(time[here] - state.time)
        shared = observed.shared[:, :, here]
        slopes = np.ascontiguousarray(shared.transpose(2, 0, 1))
        # At the end of its law an unusable estimate may have an infinite slope.
        with np.errstate(invalid="ignore"):
            offsets[:, here] = share * (state.mean @ shared)
            learned = (slopes @ state.covariance @ slopes.transpose(0, 2, 1)).transpose(1, 2, 0)
        spread[:, :, here] = share**2 * learned + (1.0 - share**2) * spread[:, :, here]
    covariance = observed.noise + lasting
    return replace(
        observed,
        offsets=offsets,
        covariance=covariance,
        residuals=observed.residuals - signed(ruleset, offsets),
        residual_u=spreads(ruleset, covariance),
        residual_systematic=spreads(ruleset, lasting),
    )
