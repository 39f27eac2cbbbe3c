"""Innovations of a reading with white noise and a wandering error.

Source: Anderson and Moore 1979, chapter 4 (the Kalman filter that has settled); Hartikainen and
Sarkka 2010 (Matern covariances as its models).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.linalg import solve_discrete_are, toeplitz
from scipy.linalg.lapack import dtbtrs

from rulec.mismatch.search import limits


@dataclass(frozen=True)
class Innovations:
    """The part of each sample that earlier ones do not predict, over its standard deviation.

    The first ones follow from `first`, shape (m, m), all others from a filter with the coefficients
    `above` over `below` and the standard deviation `spread`.
    """

    first: Array
    above: Array
    below: Array
    spread: float

    def of(self, columns: Array, runs: Sequence[slice]) -> Array:
        """Innovations of rows of one signal, shape (n,) or (n, columns), for each run by itself."""
        if not columns.size:  # LAPACK would write out of bounds.
            return columns.copy()
        rows = np.zeros((len(columns), columns[0].size))
        wide = columns.reshape(rows.shape)
        with np.errstate(all="ignore"):
            for back, share in enumerate(self.above):
                rows[back:] += share * wide[: len(wide) - back]
            band = np.repeat(self.below[:, None], len(rows), axis=1)
            found: Array = dtbtrs(band, rows, uplo="L")[0].reshape(columns.shape) / self.spread
            for run in runs:
                m = min(len(self.first), run.stop - run.start)
                own = slice(run.start - runs[0].start, run.start - runs[0].start + m)
                found[own] = self.first[:m, :m] @ columns[own]
        return found

    def logs(self, runs: Sequence[slice]) -> float:
        """Sum of the logarithms of the standard deviations."""
        own, total = np.concatenate([[0.0], np.cumsum(np.log(np.diag(self.first)))]), 0.0
        for rows in runs:
            m = min(len(self.first), rows.stop - rows.start)
            total += (rows.stop - rows.start - m) * float(np.log(self.spread)) - float(own[m])
        return total


@lru_cache(maxsize=4096)
def innovations(size: float, lasts: float, smoothness: float) -> Innovations:
    """Innovations of white noise of unit variance with a wandering error.

    `size` is the standard deviation of the error, `lasts` its correlation time in samples. A
    `smoothness` of 1 is that of a random walk (Matern 1/2); with 3 the slope is correlated too
    (Matern 3/2), as where a store integrates errors of flows.
    """
    rate = float(np.sqrt(smoothness)) / lasts
    gap = np.arange(limits.FIRST_INNOVATIONS, dtype=float)
    if smoothness > 1.0:
        alike = size**2 * (1.0 + rate * gap) * np.exp(-rate * gap)
        step = np.exp(-rate) * np.array([[1.0 + rate, 1.0], [-(rate**2), 1.0 - rate]])
        known = np.diag([size**2, (rate * size) ** 2])
    else:
        alike = size**2 * np.exp(-rate * gap)
        step, known = np.array([[np.exp(-rate)]]), np.array([[size**2]])
    shown = np.eye(1, len(step))
    first = np.linalg.inv(np.linalg.cholesky(toeplitz(alike) + np.eye(len(gap))))
    news = known - step @ known @ step.T
    ahead = solve_discrete_are(step.T, shown.T, 0.5 * (news + news.T), np.ones((1, 1)))
    whole = float(ahead[0, 0]) + 1.0
    gain = step @ ahead[:, :1] / whole @ shown
    above, below = (np.asarray(np.poly(each), dtype=np.float64) for each in (step, step - gain))
    return Innovations(first, above, below, float(np.sqrt(whole)))
