"""LISDD over the catalogue's own terms: missing terms by region, with a test of each.

As public summaries tell it: the operating space falls into regions, the cleanest of which shows the
noise; regions with more residual energy are flagged; in each one term is selected by exhaustive
hold-out over the library, and certified by an F-test on samples that did not select it; regions
share a rate of false discoveries. Made anew from the abstract: how regions are cut (medians of the
widest input) is our choice, and known physics is not refitted to the clean region, as ours is
recalibrated.

Source: Wang 2026, Where Is My Physics Wrong? (arXiv 2606.23215), abstract; Benjamini and
Hochberg 1995.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution
from scipy.stats import false_discovery_control

from tests.rig.peers import limits
from tests.rig.peers.sparse import Array


@dataclass(frozen=True)
class Discovery:
    """A term, by its column, that is missing in a region, and its weight there."""

    region: int
    column: int
    weight: float


def regions(inputs: Array, learnt: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Number of the region of each row, shape (n,), cut by the `learnt` rows.

    `inputs`, shape (n, inputs), are standardised.
    """
    number = np.zeros(len(inputs), dtype=np.intp)
    for _ in range(limits.DEPTH):
        number = 2 * number + _halves(inputs, learnt, number)
    return np.unique(number, return_inverse=True)[1]


def _halves(inputs: Array, learnt: NDArray[np.bool_], number: NDArray[np.intp]) -> NDArray[np.intp]:
    """1 in the upper half of each region, along its widest input with enough on both sides."""
    upper = np.zeros(len(inputs), dtype=np.intp)
    for region in np.unique(number[learnt]):
        inside = number == region
        own = inputs[inside & learnt]
        for column in np.argsort(-np.std(own, axis=0)):
            middle = np.median(own[:, column])
            above = int((own[:, column] > middle).sum())
            if min(above, len(own) - above) >= limits.FEWEST:
                upper[inside & (inputs[:, column] > middle)] = 1
                break
    return upper


def discovered(table: Array, residual: Array, region: NDArray[np.intp]) -> list[Discovery]:
    """Terms that are certified, by a table, shape (n, columns); others have shape (n,)."""
    known = [r for r in np.unique(region) if (region == r).sum() >= limits.FEWEST]
    energy = {r: float(np.mean(residual[region == r] ** 2)) for r in known}
    if len(known) < 2:
        return []
    clean = min(known, key=lambda r: energy[r])
    flagged = [r for r in known if _flagged(r, clean, region, energy)]
    found = [(r, *_selected(table[region == r], residual[region == r])) for r in flagged]
    if not found:
        return []
    adjusted = false_discovery_control([p for _, _, p in found])
    return [
        Discovery(int(r), j, _weight(table[region == r][:, j], residual[region == r]))
        for (r, j, _), p in zip(found, adjusted, strict=True)
        if p <= limits.FALSE
    ]


def _flagged(r: int, clean: int, region: NDArray[np.intp], energy: dict[int, float]) -> bool:
    """Is there more energy than in the clean region, by more than chance?"""
    counts = int((region == r).sum()), int((region == clean).sum())
    ratio = energy[r] / max(energy[clean], 1e-300)
    return r != clean and bool(f_distribution.sf(ratio, *counts) <= limits.FALSE)


def _selected(table: Array, residual: Array) -> tuple[int, float]:
    """The column that predicts best what it was not fitted to, and its p on a third part."""
    part = np.arange(len(residual)) * 9 // len(residual) % 3  # alternating blocks of time
    fit, hold, test = (part == k for k in range(3))
    off = [
        np.sum((residual[hold] - column[hold] * _weight(column[fit], residual[fit])) ** 2)
        for column in table.T
    ]
    j = int(np.argmin(off))
    column, own = table[test, j], residual[test]
    left = float(np.sum((own - column * _weight(column, own)) ** 2))
    gain = float(np.sum(own**2)) - left
    freedom = len(own) - 1
    return j, float(f_distribution.sf(gain * freedom / max(left, 1e-300), 1, freedom))


def _weight(column: Array, residual: Array) -> float:
    square = float(column @ column)
    return float(column @ residual) / square if square > 0 else 0.0
