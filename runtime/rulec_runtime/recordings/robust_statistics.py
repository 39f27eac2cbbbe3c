"""Estimate spread and noise by medians, which outliers, steps and slopes hardly affect, and the
autocorrelation time of an error.

Sources: Hampel 1974 (median of absolute deviations); effective number of samples for squares of an
autocorrelated series (Bartlett 1946).
"""

from math import comb

import numpy as np
from numpy.typing import NDArray

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings import limits


def spread_about(values: Array, centre: float) -> float:
    """Standard deviation of normal noise, from the median distance from a centre."""
    return common.NORMAL_SPREAD * float(np.median(np.abs(values - centre)))


def white_noise(differences: Array, order: int) -> float:
    """Standard deviation of white noise from its differences of an order; 0 without any.

    The variance of a difference is that of the noise times the sum of squared binomials.

    >>> from numpy.random import default_rng
    >>> round(white_noise(np.diff(default_rng(1).normal(0.0, 3.0, 100_000), 2), 2), 1)
    3.0
    """
    if not differences.size:
        return 0.0
    median = float(np.median(np.abs(differences)))
    return common.NORMAL_SPREAD * median / float(np.sqrt(comb(2 * order, order)))


Flags = NDArray[np.bool_]


def autocorrelation_time(error: Array, finite: Flags) -> float:
    """Samples per independent value of a squared error, at least 1.

    This is the sum of squared autocorrelations, up to the lag at which they vanish.
    """
    correlations, most = correlations_of(error, finite)
    return float(np.clip(1.0 + 2.0 * np.sum(correlations**2), 1.0, most))


def correlations_of(error: Array, finite: Flags) -> tuple[Array, int]:
    """Autocorrelations from lag 1 to the lag at which they vanish, shape (lags,), and the largest
    lag examined."""
    n, none = int(finite.sum()), np.zeros(0)
    if n < limits.FEWEST_FOR_CORRELATION:
        return none, 1
    filled = np.where(finite, error, 0.0)
    size = 2 ** int(np.ceil(np.log2(2 * len(filled))))
    moments = np.fft.irfft(np.abs(np.fft.rfft(filled, size)) ** 2, size)
    counts = np.fft.irfft(np.abs(np.fft.rfft(finite.astype(float), size)) ** 2, size)
    most = max(int(limits.LONGEST_CORRELATION * n), 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        lags = np.where(counts[:most] > 0.5, moments[:most] / np.maximum(counts[:most], 1.0), 0.0)
    if lags[0] <= 0.0:
        return none, 1
    correlation = lags / lags[0]
    ends = np.flatnonzero(correlation[1:] < limits.WHITE_CORRELATION / np.sqrt(n))
    return (correlation[1 : 1 + ends[0]] if len(ends) else correlation[1:]), most
