"""Stretches stacked to one problem: a degree that fits one of them must fit all."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.baseline import remembered, times_of
from rulec_runtime.diagnosis.steady.batches import of_points
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, Scales
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import residual_basis


def spread_evenly(
    observed: Observed, members: Sequence[int] | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Some stretches of a run, spread evenly, that share their usable observers."""
    chosen = np.asarray(members)
    patterns, group, counts = np.unique(
        observed.valid[:, chosen], axis=1, return_inverse=True, return_counts=True
    )
    usual = int(np.argmax(counts))
    return thinned(chosen[np.ravel(group) == usual]), patterns[:, usual]


def thinned(points: np.ndarray) -> np.ndarray:
    """At most as many points as are stacked, spread evenly."""
    places = np.linspace(0, len(points) - 1, min(limits.STACKED, len(points))).round().astype(int)
    some: np.ndarray = points[places]
    return some


def stacked_test(
    ruleset: Ruleset, observed: Observed, valid: np.ndarray, members: np.ndarray, present: Array
) -> HypothesisTest:
    """Test of stacks, n of them, of points: `members` and `present` of shape (points, n)."""
    basis = residual_basis(ruleset, valid)
    return HypothesisTest(
        ruleset=ruleset,
        observed=observed,
        valid=valid,
        basis=basis,
        members=members,
        present=present,
        spread=partial(_covariance, observed, valid, basis),
    )


def _covariance(
    observed: Observed, valid: np.ndarray, basis: Array, members: np.ndarray, scales: Scales | None
) -> Array:
    """Covariance of the residuals of stacks, shape (n, points * rank, points * rank)."""
    rank, (points, n) = len(basis), members.shape
    every, own = members.ravel(), np.flatnonzero(valid)
    shared = of_points(observed.shared, (own, np.arange(observed.shared.shape[1])), every)
    shared = shared.reshape(*shared.shape[:2], points, n)
    noise = of_points(np.moveaxis(observed.noise, 0, -1), (own, own), every)
    noise = noise.reshape(*noise.shape[:2], points, n)
    if scales is not None:
        shared = shared * scales.lasting[:, None]
        noise = noise * scales.noise[:, None] * scales.noise
    gradients = (
        np.tensordot(basis, shared, axes=1).transpose(3, 2, 0, 1).reshape(n, -1, len(shared[0]))
    )
    time = times_of(observed)[members]
    lasts = remembered(time[:, None] - time).transpose(2, 0, 1)
    whole = (gradients @ gradients.transpose(0, 2, 1)).reshape(n, points, rank, points, rank)
    whole *= lasts[:, :, None, :, None]
    half = np.tensordot(basis, noise, axes=1)
    own = np.tensordot(basis, half, axes=(1, 1)).transpose(3, 2, 0, 1)
    for point in range(points):
        whole[:, point, :, point] += own[:, point]
    return whole.reshape(n, points * rank, points * rank)
