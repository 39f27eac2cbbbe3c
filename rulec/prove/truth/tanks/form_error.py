"""A law's form error in plain numbers, for thousands of calls by a balance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..smooth import Form
from ..spread import series_of
from ..units import Array


@dataclass(frozen=True)
class Bend:
    """The relative error of a law: a series of Legendre polynomials from `low` to `high` of its
    argument, constant beyond. `rms` is its root mean square."""

    rms: float
    low: float
    high: float
    series: tuple[float, ...]

    @classmethod
    def of(cls, form: Form) -> Bend:
        """Convert a form error of one argument."""
        ((low, high),) = form.ranges
        return cls(form.rms, low, high, tuple(series_of(form).tolist()))

    def at(self, value: float) -> float:
        """Return the share, 1.

        Source: Clenshaw 1955.
        """
        x = min(max(2.0 * (value - self.low) / (self.high - self.low) - 1.0, -1.0), 1.0)
        last = before = 0.0
        for k in range(len(self.series) - 1, 0, -1):
            last, before = (
                self.series[k] + (2 * k + 1) / (k + 1) * x * last - (k + 1) / (k + 2) * before,
                last,
            )
        return self.series[0] + x * last - 0.5 * before

    def further(self, by: Array) -> Bend:
        """Add another series, shape (NODES,)."""
        return replace(self, series=tuple((np.asarray(self.series) + by).tolist()))
