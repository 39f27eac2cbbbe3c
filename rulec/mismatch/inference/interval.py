"""How certain a value is, and with what it is confounded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.model import Line
from rulec.mismatch.inference import limits
from rulec.mismatch.result import Confounded


def profile(line: Line) -> tuple[float, float]:
    """95 % interval of a value by its profile likelihood, SI.

    Source: Venzon and Moolgavkar 1988.
    """
    low, high = (_end(line, side) for side in (-1.0, 1.0))
    return low, high


def _end(line: Line, side: float) -> float:
    """Where the likelihood has fallen by enough on one side, within the range."""
    reach = line.value - line.lowest if side < 0 else line.highest - line.value
    pace = line.pace
    step, inside, outside = min(common.NORMAL_95 * line.u, reach), 0.0, np.inf
    for _ in range(pace.steps):
        if step <= 0.0:
            break
        fall = line.fall(side * step)
        if fall < common.DROP:
            inside = step
            if step >= reach:
                break
            ratio = float(np.sqrt(common.DROP / fall)) if fall > 0 else pace.uphill
            grow = float(np.clip(ratio, pace.shortest, limits.LONGEST_STEP))
            between = 0.5 * (inside + outside) if np.isfinite(outside) else reach
            step = min(step * grow, reach, between)
        else:
            outside = step
            step = max(step * float(np.sqrt(common.DROP / fall)), 0.25 * (inside + outside))
        if abs(fall - common.DROP) < pace.near:
            break
    return float(line.value + side * step)


def confounded(
    names: Sequence[str], covariance: Array, unknowns: frozenset[str]
) -> tuple[Confounded, ...]:
    """Unknowns of explanations that correlate with another value, the most correlated first.

    `covariance`, shape (names, names), is that of the values with these names.
    """
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(size, size)
    found = [
        Confounded(first, second, float(correlation[i, j]))
        for i, first in enumerate(names)
        for j, second in enumerate(names)
        if first in unknowns and (second not in unknowns or j > i)
        if abs(correlation[i, j]) > limits.CONFOUNDED
    ]
    return tuple(sorted(found, key=lambda pair: -abs(pair.correlation)))
