"""How much an error of a simulation says: its size, and for how long it stays as it is.

A plain model is off for long stretches. Were its errors counted as if each sample were new, every
candidate that bends the curve would seem proven a thousand times over. So squares of errors are
counted once per memory of what remains.

Source: effective number of samples for squares of an autocorrelated series (Bartlett 1946).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.plan import Array

Flags = NDArray[np.bool_]

LONGEST = 0.1
"""The memory is at most this share of the samples: no recording shows more."""


@dataclass(frozen=True)
class Noise:
    """Standard deviation of an error (SI), and the number of samples that say one new thing."""

    spread: float
    memory: float

    @property
    def weight(self) -> float:
        """What an error is divided by, so that a square counts as one nat and a half."""
        return float(self.spread * np.sqrt(self.memory))


def noise_of(error: Array, known: Flags, least: float) -> Noise:
    """The noise that an error shows.

    Parameters
    ----------
    error : shape (n,); where it is not `known`, it does not count.
    least : standard deviation at least, such as the resolution of the sensor.
    """
    seen = error[known]
    spread = float(np.sqrt(np.mean(seen**2))) if len(seen) else least
    return Noise(max(spread, least), memory_of(error, known))


def memory_of(error: Array, known: Flags) -> float:
    """Samples that say one new thing about the size of an error, at least 1.

    That is the sum of squared autocorrelations, up to where they vanish (Bartlett 1946).
    """
    n = int(known.sum())
    if n < 8:
        return 1.0
    filled = np.where(known, error, 0.0)
    size = 2 ** int(np.ceil(np.log2(2 * len(filled))))
    moments = np.fft.irfft(np.abs(np.fft.rfft(filled, size)) ** 2, size)
    counts = np.fft.irfft(np.abs(np.fft.rfft(known.astype(float), size)) ** 2, size)
    most = max(int(LONGEST * n), 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        lags = np.where(counts[:most] > 0.5, moments[:most] / np.maximum(counts[:most], 1.0), 0.0)
    if lags[0] <= 0.0:
        return 1.0
    correlation = lags / lags[0]
    floor = 2.0 / np.sqrt(n)
    ends = np.flatnonzero(correlation[1:] < floor)
    kept = correlation[1 : 1 + ends[0]] if len(ends) else correlation[1:]
    return float(np.clip(1.0 + 2.0 * np.sum(kept**2), 1.0, most))


def gain(before: Noise, after: Noise, samples: int) -> float:
    """By how much the logarithm of the likelihood rises, the size of the noise being unknown."""
    count = samples / max(after.memory, 1.0)
    return float(count * np.log(before.spread / after.spread))
