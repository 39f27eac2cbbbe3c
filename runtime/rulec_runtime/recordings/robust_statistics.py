"""Estimate spread and noise by medians, which outliers, steps and slopes hardly affect.

Source: Hampel 1974 (median of absolute deviations).
"""

from __future__ import annotations

from math import comb

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.blockwise import Parts, median_of


def spread_about(values: Array, centre: float) -> float:
    """Standard deviation of normal noise, from the median distance from a centre."""
    return limits.NORMAL_SPREAD * float(np.median(np.abs(values - centre)))


def medians(table: Array) -> Array:
    """Median of each row, shape (rows,); faster than numpy's for short rows.

    >>> medians(np.array([[3.0, 1.0, 2.0, 9.0], [1.0, np.nan, 2.0, 3.0]])).tolist()
    [2.5, nan]
    """
    ordered = np.sort(table, axis=1)
    count = ordered.shape[1]
    middle = 0.5 * (ordered[:, (count - 1) // 2] + ordered[:, count // 2])
    return np.where(np.isnan(ordered[:, -1]), np.nan, middle)


def white_noise(differences: Array, order: int) -> float:
    """Standard deviation of white noise from its differences of an order; 0 without any.

    The variance of a difference is that of the noise times the sum of squared binomials.

    >>> from numpy.random import default_rng
    >>> round(white_noise(np.diff(default_rng(1).normal(0.0, 3.0, 100_000), 2), 2), 1)
    3.0
    """
    if not differences.size:
        return 0.0
    return white_noise_of(lambda: (differences.ravel(),), order)


def white_noise_of(differences: Parts, order: int) -> float:
    """The same for differences in parts; NaN without any."""
    median = median_of(lambda: (np.abs(part) for part in differences()))
    return limits.NORMAL_SPREAD * median / float(np.sqrt(comb(2 * order, order)))
