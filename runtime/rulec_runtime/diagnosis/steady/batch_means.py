"""Variation of estimates within a stretch beyond white noise: a reading still settles, or wanders.

The noise of a mean falls with the root of its length only if samples are independent. The halves of
a stretch show whether they are: a mean is known no better than its halves agree. A common course of
all estimates of a flow is the plant's own, and is left out.

Source: batch means with two batches; of the square of their difference counts the excess over the
noise, the positive part of its moment estimate (DerSimonian and Laird 1986).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.chi_square import inverse_of
from rulec_runtime.diagnosis.steady.observe import Observed, flows_at
from rulec_runtime.diagnosis.steady.points import means_of_stretches
from rulec_runtime.diagnosis.steady.redundancy import covariance_of, groups_of
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Stretches


@dataclass(frozen=True)
class Halves:
    """Flows in the second half of each stretch less those in the first, m3/s, shape (observers, n),
    and the variance of this over that of the mean of all, for white noise, shape (n,)."""

    apart: Array
    excess: Array

    def part(self, observers: np.ndarray, chosen: slice) -> Halves:
        """The same of some observers and stretches."""
        return Halves(self.apart[observers, chosen], self.excess[chosen])


def halves_of(recording: Recording, ruleset: Ruleset, stretches: Stretches) -> Halves:
    """Cut every stretch in the middle."""
    middle = stretches.first + stretches.lengths // 2
    early, late = (Stretches(stretches.first, middle), Stretches(middle, stretches.last))
    before, after = (
        flows_at(ruleset, means_of_stretches(recording, ruleset, part)) for part in (early, late)
    )
    return Halves(after - before, stretches.lengths**2 / (early.lengths * late.lengths))


def drift_of(ruleset: Ruleset, observed: Observed, halves: Halves) -> Array:
    """Covariance of flows by the excess difference of halves, (m3/s)^2, (n, observers,
    observers)."""
    found = np.zeros_like(observed.noise)
    for valid, members, basis in groups_of(ruleset, observed.valid & np.isfinite(halves.apart)):
        apart = (basis @ halves.apart[valid][:, members]).T
        white = covariance_of(basis, observed.scatter, valid, members)
        white = white * halves.excess[members, None, None]
        distance = np.einsum("ni,nij,nj->n", apart, inverse_of(white), apart)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(distance > len(basis), 1.0 - len(basis) / distance, 0.0)
        # The mean of two batches has a quarter of the variance of their difference.
        half = 0.5 * np.sqrt(share)[:, None] * (apart @ basis)
        found[np.ix_(members, valid, valid)] = half[:, :, None] * half[:, None, :]
    return found


def with_drift(observed: Observed, drift: Array) -> Observed:
    """The same points with this covariance added to their noise."""
    noise, covariance = observed.noise + drift, observed.covariance + drift
    return replace(observed, noise=noise, covariance=covariance, drift=drift)
