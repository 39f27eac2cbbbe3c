"""The autocorrelation time of an error, in samples.

Source: effective number of samples for squares of an autocorrelated series (Bartlett 1946).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings import limits

Flags = NDArray[np.bool_]


def memory_of(error: Array, known: Flags) -> float:
    """Samples per independent value of a squared error, at least 1.

    This is the sum of squared autocorrelations, up to the lag at which they vanish.
    """
    kept, most = correlations_of(error, known)
    return float(np.clip(1.0 + 2.0 * np.sum(kept**2), 1.0, most))


def correlations_of(error: Array, known: Flags) -> tuple[Array, int]:
    """Autocorrelations from lag 1 to the lag at which they vanish, shape (lags,), and the largest
    lag examined."""
    n, none = int(known.sum()), np.zeros(0)
    if n < limits.FEWEST_FOR_CORRELATION:
        return none, 1
    filled = np.where(known, error, 0.0)
    size = 2 ** int(np.ceil(np.log2(2 * len(filled))))
    moments = np.fft.irfft(np.abs(np.fft.rfft(filled, size)) ** 2, size)
    counts = np.fft.irfft(np.abs(np.fft.rfft(known.astype(float), size)) ** 2, size)
    most = max(int(limits.LONGEST_CORRELATION * n), 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        lags = np.where(counts[:most] > 0.5, moments[:most] / np.maximum(counts[:most], 1.0), 0.0)
    if lags[0] <= 0.0:
        return none, 1
    correlation = lags / lags[0]
    ends = np.flatnonzero(correlation[1:] < limits.WHITE_CORRELATION / np.sqrt(n))
    return (correlation[1 : 1 + ends[0]] if len(ends) else correlation[1:]), most
