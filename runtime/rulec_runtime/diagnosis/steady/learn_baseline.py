"""Learn the baseline: condition on the points in order of time.

Source: own derivation, docs/method.md; the recursion is a Kalman filter of an Ornstein-Uhlenbeck
process.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.baseline import (
    Baseline,
    Baselines,
    nothing_learned,
    times_of,
)
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit, covariance_of, groups_of


class Learner:
    """Learns from points that come in batches; all baselines are kept if `keep`."""

    def __init__(self, ruleset: Ruleset, *, keep: bool) -> None:
        self._ruleset, self._keep = ruleset, keep
        self._last: Baseline | None = None
        self._kept: list[Baseline] = []
        self._at: list[np.ndarray] = []
        self._counts = [0]

    def take(self, observed: Observed, first: int) -> Baselines:
        """Learn from a batch that begins with point `first`; the baselines that apply to it."""
        states = [self._last or nothing_learned(observed)]
        at = np.zeros(len(observed), dtype=int)
        groups = {int(p): g for g in _groups_by(self._ruleset, observed) for p in g.points}
        for point, group in ((p, groups[p]) for p in sorted(groups)):
            at[point] = len(states) - 1
            taken = group.taken_up(states[-1], point)
            if taken is not None:
                states.append(taken)
                taken.points.append(first + point)
        at = np.maximum.accumulate(at)
        if self._keep:
            self._kept += states[bool(self._kept) :]
        self._last = states[-1]
        self._at.append(at + len(self._counts) - 1)
        self._counts.extend(state.count for state in states[1:])
        return Baselines(states, at)

    def baselines(self) -> Baselines:
        """All baselines learned."""
        points = () if self._last is None else self._last.points
        return Baselines(self._kept, np.concatenate(self._at), points, self._counts)


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

    def taken_up(self, before: Baseline, point: int) -> Baseline | None:
        """Condition on a point; None if it is unsound, deviates, or adds next to nothing."""
        place = int(np.searchsorted(self.points, point))
        if not self.sound[place]:
            return None
        before = before.later(float(self.time[place]))
        residuals, shared = self.residuals[place], self.shared[place]
        crossed = before.covariance @ shared.T
        total = self.noise[place] + shared @ crossed
        off = residuals - shared @ before.mean
        try:
            solved = np.linalg.solve(total, np.column_stack([off, crossed.T]))
        except np.linalg.LinAlgError:  # readings so far off that rounding hides their errors
            return None
        if off @ solved[:, 0] > chi_square_limit(len(off), common.CALM):
            return None
        gain = np.linalg.slogdet(total)[1] - self.log_determinant[place]
        if gain < limits.WORTH_LEARNING * len(off):
            return None
        covariance = before.covariance - crossed @ solved[:, 1:]
        return replace(
            before,
            mean=before.mean + crossed @ solved[:, 0],
            covariance=0.5 * (covariance + covariance.T),
            count=before.count + 1,
        )


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
