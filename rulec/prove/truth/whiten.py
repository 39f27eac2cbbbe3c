"""Whitening of coloured noise, so that plain sums of squares hold.

Each output has its own noise and that of inputs, both of first order; their sum has no finite
order. A Kalman filter predicts each sample from those before; its innovation over its uncertainty
is white.

Source: Kalman 1960; prediction error decomposition, Schweppe 1965. Samples that do not count are
only predicted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .units import Array


@dataclass(frozen=True)
class Whitening:
    """Noise of several outputs over time.

    Attributes
    ----------
    sizes : of each source of noise in each output, shape (n, outputs, sources)
    colours : first-order coefficient of each source, shape (sources,)
    seen : whether an output counts, bool, shape (n, outputs)
    """

    sizes: Array
    colours: Array
    seen: np.ndarray
    _filter: tuple[tuple[Array, Array, Array], ...]

    @classmethod
    def of(cls, sizes: Array, colours: Array, seen: np.ndarray) -> Whitening:
        """Compute the filter of all samples, which depends on no reading."""
        return cls(sizes, colours, seen, tuple(_filter_of(sizes, colours, seen)))

    def __call__(self, values: Array) -> Array:
        """Whiten values of all outputs, shape (n, outputs, k).

        Returns shape (samples that count, k); the noise becomes independent with variance 1.
        """
        state = np.zeros((self.colours.size, values.shape[2]))
        found = []
        for now, seen, (matrix, gain, scale) in zip(values, self.seen, self._filter, strict=True):
            innovation = now[seen] - matrix @ state
            found.append(scale @ innovation)
            state = self.colours[:, None] * (state + gain @ innovation)
        return np.concatenate(found)


def _filter_of(
    sizes: Array, colours: Array, seen: np.ndarray
) -> Iterator[tuple[Array, Array, Array]]:
    """Of each sample: observation matrix, gain, and scale of the innovation."""
    spread = np.eye(colours.size)
    fresh, remembered = np.diag(1.0 - colours**2), np.outer(colours, colours)
    for size, counts in zip(sizes, seen, strict=True):
        matrix = size[counts]
        covariance = matrix @ spread @ matrix.T
        scale = np.linalg.inv(np.linalg.cholesky(covariance))
        gain = spread @ matrix.T @ scale.T @ scale
        left = spread - gain @ matrix @ spread
        spread = remembered * (left + left.T) / 2.0 + fresh
        yield matrix, gain, scale
