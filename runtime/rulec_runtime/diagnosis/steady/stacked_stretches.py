"""Stretches stacked to one problem: a degree that fits one of them must fit all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.baseline import remembered, times_of
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, Scales
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import residual_basis

Wanders = tuple[tuple[float, float], ...]


def spread_evenly(
    observed: Observed, members: Sequence[int] | np.ndarray, most: int = limits.STACKED
) -> tuple[np.ndarray, np.ndarray]:
    """Some stretches of a run, spread evenly, that share their usable observers."""
    chosen = np.asarray(members)
    patterns, group, counts = np.unique(
        observed.valid[:, chosen], axis=1, return_inverse=True, return_counts=True
    )
    usual = int(np.argmax(counts))
    return thinned(chosen[np.ravel(group) == usual], most), patterns[:, usual]


def thinned(points: np.ndarray, most: int = limits.STACKED) -> np.ndarray:
    """At most so many points, spread evenly."""
    places = np.linspace(0, len(points) - 1, min(most, len(points))).round().astype(int)
    return np.asarray(points[places])


def stacked_test(
    ruleset: Ruleset,
    observed: Observed,
    valid: np.ndarray,
    members: np.ndarray,
    present: Array,
    wanders: Wanders = ((limits.LASTING, 1.0),),
) -> HypothesisTest:
    """Test of stacks, n of them, of points: `members` and `present` of shape (points, n).

    `wanders` are time constants of lasting errors, s, with their shares of the variance.
    """
    basis = residual_basis(ruleset, valid)
    return HypothesisTest(
        ruleset=ruleset,
        observed=observed,
        valid=valid,
        basis=basis,
        members=members,
        present=present,
        spread=_Stacked(observed, valid, basis, wanders),
    )


@dataclass(frozen=True)
class _Stacked:
    """Uncertainty of the residuals of stacks."""

    observed: Observed
    valid: np.ndarray
    basis: Array
    wanders: Wanders
    known: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)

    def whole(self, members: np.ndarray, scales: Scales | None) -> Array:
        basis, rank, (points, n) = self.basis, len(self.basis), members.shape
        shared, noise = self._errors(members)
        if scales is not None:
            shared = shared * scales.lasting[:, None]
            noise = noise * scales.noise[:, None] * scales.noise
        gradients = (
            np.tensordot(basis, shared, axes=1).transpose(3, 2, 0, 1).reshape(n, -1, len(shared[0]))
        )
        lasts = self._lasts(members)
        whole = (gradients @ gradients.transpose(0, 2, 1)).reshape(n, points, rank, points, rank)
        whole *= lasts[:, :, None, :, None]
        half = np.tensordot(basis, noise, axes=1)
        own = np.tensordot(basis, half, axes=(1, 1)).transpose(3, 2, 0, 1)
        for point in range(points):
            whole[:, point, :, point] += own[:, point]
        return whole.reshape(n, points * rank, points * rank)

    def seen_by(self, basis: Array) -> _Stacked:
        return replace(self, basis=basis)

    def _errors(self, members: np.ndarray) -> tuple[Array, Array]:
        """Slopes of the usable flows by lasting errors, and the covariance of errors new at each
        point, points and problems last."""
        key = members.tobytes()
        if key not in self.known:
            # Kept for the same problems with other residuals, which follow next.
            self.known.clear()
            own, every = np.flatnonzero(self.valid), members.ravel()
            shared = self.observed.shared[..., every][own]
            noise = np.moveaxis(self.observed.noise[every][:, own][:, :, own], 0, -1)
            self.known[key] = (
                shared.reshape(*shared.shape[:2], *members.shape),
                noise.reshape(*noise.shape[:2], *members.shape),
            )
        return self.known[key]

    def _lasts(self, members: np.ndarray) -> Array:
        """Correlation of lasting errors between points, shape (n, points, points)."""
        time = times_of(self.observed)[members]
        apart = time[:, None] - time
        kept = sum(part * remembered(apart, each) for each, part in self.wanders)
        return np.asarray(kept).transpose(2, 0, 1)
