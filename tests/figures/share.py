"""A share that was counted, with what the count says of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from scipy.stats import beta

SURE = 0.95
"""Confidence of the intervals: that of the tool's own bounds."""


@dataclass(frozen=True)
class Share:
    """`count` out of `of`."""

    count: int
    of: int

    @property
    def value(self) -> float:
        """The share; not a number of nothing."""
        return self.count / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Bounds of the share in a long run.

        Source: Clopper and Pearson, Biometrika 26 (1934) 404; SURE of all such intervals hold
        the true share if the trials are independent.
        """
        tail = (1.0 - SURE) / 2.0
        low = beta.ppf(tail, self.count, self.of - self.count + 1) if self.count else 0.0
        high = beta.ppf(1.0 - tail, self.count + 1, self.of - self.count)
        return float(low), float(high) if self.count < self.of else 1.0

    def form(self) -> dict[str, Any]:
        """Machine form; null for a share of nothing."""
        if not self.of:
            return {"count": 0, "of": 0, "value": None, "low": None, "high": None}
        low, high = self.interval
        return {
            "count": self.count,
            "of": self.of,
            "value": round(self.value, 6),
            "low": round(low, 6),
            "high": round(high, 6),
        }
