"""The noise of a simulation error: its size and its memory.

A plain model is off for long stretches. If every sample counted as independent, every candidate
that bends the course would seem certain. So squares of errors count once per memory of the error.

Source: effective number of samples for squares of an autocorrelated series (Bartlett 1946).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust_statistics import Flags, correlations_of, memory_of


@dataclass(frozen=True)
class Noise:
    """Standard deviation of an error, SI, and the number of samples per independent one."""

    spread: float
    memory: float

    @property
    def weight(self) -> float:
        """Divisor of an error that makes half its square a loss of log likelihood, nats."""
        return float(self.spread * np.sqrt(self.memory))


def noise_of(error: Array, known: Flags, least: float) -> Noise:
    """Estimate the noise of an error.

    Parameters
    ----------
    error : shape (n,); only `known` samples count.
    least : lower bound of the standard deviation, such as the resolution of the sensor.
    """
    own = error[known]
    spread = float(np.sqrt(np.mean(own**2))) if len(own) else least
    return Noise(max(spread, least), memory_of(error, known))


def score_covariance(columns: Array, error: Array, known: Flags) -> Array:
    """Covariance of the products of columns with an error correlated in time.

    Parameters
    ----------
    columns : shape (n, k), zero where the error is not `known`.
    error : shape (n,); its autocorrelations count up to where they vanish.

    Returns shape (k, k), per variance of the error.

    Source: Newey and West 1987; a negative spectrum counts as zero.
    """
    size = 2 ** int(np.ceil(np.log2(2 * len(error))))
    kept = correlations_of(error, known)[0]
    course = np.zeros(size)
    course[0] = 1.0
    course[1 : 1 + len(kept)] = kept
    course[size - len(kept) :] = kept[::-1]
    spectrum = np.maximum(np.fft.rfft(course).real, 0.0)
    waves = np.fft.rfft(columns, size, axis=0)
    double = np.full(len(spectrum), 2.0)
    double[[0, -1]] = 1.0
    weighted = waves.conj() * (spectrum * double)[:, None]
    found: Array = (weighted.T @ waves).real / size
    return 0.5 * (found + found.T)


def gain(before: Noise, after: Noise, samples: int) -> float:
    """Rise of the log likelihood, with the size of the noise unknown."""
    count = samples / max(after.memory, 1.0)
    return float(count * np.log(before.spread / after.spread))
