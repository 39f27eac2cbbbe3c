"""Parameters by data sheet, combined with those fitted to a recording.

Both are estimates with uncertainties, weighted by them (best linear unbiased estimate). A recording
often determines the sum of two losses well, but neither of them; the data sheet then separates
them. Where the two differ by more than their uncertainties, the data sheet's variances grow with
chi-square over the degrees of freedom (Birge ratio). Where they contradict each other, the data
sheet is left out.

Source: JCGM 100 (GUM), 4.3, for what is known before; Birge 1932 for the factor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.special import chdtrc

from rulec.knowledge.module_type import Parameter
from rulec.limits import CONTRADICTION


@dataclass(frozen=True)
class Sheet:
    """Values stated before a recording, shape (n,), with their precision (1/u^2; 0: not stated)."""

    values: Array
    precision: Array

    @classmethod
    def of(cls, stated: Sequence[Parameter]) -> Sheet:
        """By type and plant; what has no uncertainty states nothing."""
        u = np.array([p.u for p in stated])
        precision = np.where(u > 0.0, 1.0 / np.where(u > 0.0, u, 1.0) ** 2, 0.0)
        return cls(np.array([p.value for p in stated]), precision)

    def scaled(self, scale: Array) -> Sheet:
        """In units of a scale."""
        return Sheet(self.values / scale, self.precision * scale**2)

    def beside(self, found: Array, covariance: Array) -> Sheet:
        """The sheet, with its precision reduced as far as it contradicts a recording.

        `found` are the values by the recording alone, shape (n,), with `covariance`, shape (n, n).

        >>> sheet, recording = Sheet(np.array([0.7]), np.array([1e4])), np.eye(1) * 3e-4
        >>> [1e4 / sheet.beside(np.array([v]), recording).precision for v in (0.71, 0.74)]
        [array([1.]), array([4.])]
        >>> sheet.beside(np.array([0.8]), recording).is_empty
        True
        """
        known = np.flatnonzero(self.precision)
        if not len(known):
            return self
        off = (found - self.values)[known]
        both = covariance[np.ix_(known, known)] + np.diag(1.0 / self.precision[known])
        square = float(off @ np.linalg.solve(both, off))
        if chdtrc(len(known), square) < CONTRADICTION:
            return Sheet(self.values, np.zeros_like(self.precision))
        return Sheet(self.values, self.precision / max(square / len(known), 1.0))

    @property
    def is_empty(self) -> bool:
        """Does it say nothing?"""
        return not np.any(self.precision)

    def weight(self, covariance: Array) -> Array:
        """Weight of the recording, shape (n, n); that of the sheet is what lacks to the identity.

        >>> Sheet(np.array([0.7]), np.array([1e4])).weight(np.eye(1) * 3e-4)
        array([[0.25]])
        >>> Sheet(np.array([0.7]), np.array([1e4])).weight(np.zeros((1, 1)))
        array([[1.]])
        """
        size = np.sqrt(np.diag(covariance))
        size = np.where(size > 0.0, size, 1.0)  # what a recording says exactly has all the weight
        inner = covariance / np.outer(size, size) * (self.precision * size**2)
        weight = np.linalg.inv(np.eye(len(size)) + inner)
        return np.asarray(weight * np.outer(size, 1.0 / size))

    def joined(self, found: Array, weight: Array) -> Array:
        """Values by both."""
        return np.asarray(self.values + weight @ (found - self.values))

    def share(self, weight: Array) -> Array:
        """Covariance that the sheet's uncertainty leaves in what was joined, shape (n, n)."""
        rest = np.eye(len(weight)) - weight
        known = self.precision > 0.0
        variance = np.where(known, 1.0 / np.where(known, self.precision, 1.0), 0.0)
        return np.asarray((rest * variance) @ rest.T)
