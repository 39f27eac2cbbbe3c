"""Do two rankings agree? Orders of a few machines, from degrees that nobody labelled."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import kendalltau, spearmanr

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Order:
    """Rank correlations of `names`; `p` is Kendall's, exact for so few."""

    names: tuple[str, ...]
    spearman: float
    kendall: float
    p: float


def order(first: Array, second: Array, names: tuple[str, ...]) -> Order:
    """Compare two values per name; those that lack one are left out."""
    both = np.isfinite(first) & np.isfinite(second)
    kept = tuple(n for n, ok in zip(names, both, strict=True) if ok)
    tau = kendalltau(first[both], second[both])
    rho = float(spearmanr(first[both], second[both]).statistic)
    return Order(kept, rho, float(tau.statistic), float(tau.pvalue))


def same_order(table: Array) -> tuple[int, int]:
    """Pairs of rows in the same order in two columns following, and pairs compared.

    `table` has shape (machines, days); NaN where a machine was not judged.
    """
    same = total = 0
    for before, after in zip(table.T[:-1], table.T[1:], strict=True):
        for a, b in combinations(range(len(before)), 2):
            change = (before[a] - before[b]) * (after[a] - after[b])
            if np.isfinite(change):
                total += 1
                same += int(change > 0)
    return same, total


def medians(values: Array, fewest: int) -> Array:
    """Median of each row over its finite entries, NaN where they are fewer than `fewest`."""
    kept = [row[np.isfinite(row)] for row in values]
    return np.array([np.median(k) if len(k) >= fewest else np.nan for k in kept])
