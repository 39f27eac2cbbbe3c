"""Makes noise with a memory white: what it hides is then told by plain sums of squares.

Each output has noise of its own and noise of inputs, both of order one; together they are of no
finite order. The filter of Kalman predicts each sample from those before; what it did not predict,
over its uncertainty, is white.

Source: Kalman 1960; prediction error decomposition, Schweppe 1965. Samples that are not seen are
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
    colours : coefficient of order one of each source, shape (sources,)
    seen : which outputs count, bool, shape (n, outputs)
    """

    sizes: Array
    colours: Array
    seen: np.ndarray
    _filter: tuple[tuple[Array, Array, Array], ...]

    @classmethod
    def of(cls, sizes: Array, colours: Array, seen: np.ndarray) -> Whitening:
        """Run the filter's uncertainty through all samples: it depends on no reading."""
        return cls(sizes, colours, seen, tuple(_filter_of(sizes, colours, seen)))

    def __call__(self, values: Array) -> Array:
        """Values of all outputs, shape (n, outputs, k), made white; shape (samples that count, k).

        The noise itself becomes independent, with variance 1.
        """
        state = np.zeros((self.colours.size, values.shape[2]))
        found = []
        for now, seen, (matrix, gain, scale) in zip(values, self.seen, self._filter, strict=True):
            surprise = now[seen] - matrix @ state
            found.append(scale @ surprise)
            state = self.colours[:, None] * (state + gain @ surprise)
        return np.concatenate(found)


def _filter_of(
    sizes: Array, colours: Array, seen: np.ndarray
) -> Iterator[tuple[Array, Array, Array]]:
    """Of each sample: what is seen of the sources, the gain, and the scale of the surprise."""
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
