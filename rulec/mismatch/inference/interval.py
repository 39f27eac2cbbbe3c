"""Step 5: how certain a parameter is, and what it is confounded with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.result import Confounded

CONFOUNDED = 0.9
"""Correlation beyond which two values are not told apart."""

DROP = 1.92
"""Fall of the log likelihood at the ends of a 95 % interval (chi-square with one degree, half)."""

REFINED = 4
"""Steps of the search for each end."""


def profile(fitted: Fitted, name: str) -> tuple[float, float]:
    """95 % interval of a value by its profile likelihood, all others refitted.

    Neighbours count as what they are worth (`Fitted.temper`).

    Source: Venzon and Moolgavkar 1988.
    """
    i = fitted.prior.names.index(name)
    u = fitted.u(name)
    best = fitted.setting.values[name]
    ends = []
    for side in (-1.0, 1.0):
        low, high = 0.0, 1.96 * u
        limit = fitted.prior.lowest[i] if side < 0 else fitted.prior.highest[i]
        reach = abs(limit - best)
        if reach <= 0 or u == 0:
            ends.append(best)
            continue
        step = min(high, reach)
        for _ in range(REFINED):
            fall = _fall(fitted, name, best + side * step)
            if fall < DROP:
                if step >= reach:
                    break
                low, step = (
                    step,
                    min(step * (1.2 if fall <= 0 else min(np.sqrt(DROP / fall), 3.0)), reach),
                )
            else:
                high = step
                step = max(low, step * float(np.sqrt(DROP / fall)))
            if abs(fall - DROP) < 0.15:
                break
        ends.append(float(best + side * step))
    return ends[0], ends[1]


def _fall(fitted: Fitted, name: str, value: float) -> float:
    held: Mapping[str, float] = {name: value}
    there = fit(fitted.rows, fitted.setting, fitted.used, 4, held, fitted.temper)
    return there.objective - fitted.objective


def confounded(fitted: Fitted) -> tuple[Confounded, ...]:
    """Unknowns that go along with another value."""
    names = fitted.prior.names
    unknowns = set(fitted.setting.free_unknowns())
    size = np.sqrt(np.diag(fitted.covariance))
    correlation = fitted.covariance / np.outer(size, size)
    found = []
    for i, first in enumerate(names):
        if first not in unknowns or "#" in first:
            continue
        for j, second in enumerate(names):
            if (second in unknowns and j <= i) or "#" in second:
                continue
            if abs(correlation[i, j]) > CONFOUNDED:
                found.append(Confounded(first, second, float(correlation[i, j])))
    return tuple(found)
