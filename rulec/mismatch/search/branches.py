"""How a driver came to each point, and how far two branches lie apart.

Source: Mayergoyz 2003 (a law with memory has branches).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.mismatch.search import limits


def enough_visits(
    at: Array, side: Array, visit: NDArray[np.intp], used: Array
) -> tuple[int, int] | None:
    """Visits of the range that was reached from both sides, from below and from above; None where
    either are too few.

    `at`, `side`, `visit` and flags `used`, shape (n,): the driver, how it came (see `ways_there`),
    the number of the visit, and what counts.
    """
    known = (np.asarray(used) != 0) & np.isfinite(at) & (side != 0)
    if not known.any():
        return None
    number = np.unique(visit[known], return_inverse=True)[1]
    count = np.bincount(number)
    mean, way = (np.bincount(number, v[known]) / count for v in (at, side))
    return visits_on_branches(mean, way)


def visits_on_branches(at: Array, way: Array) -> tuple[int, int] | None:
    """The same by means of visits, shape (visits,)."""
    up, down = at[way > 0], at[way < 0]
    if not (len(up) and len(down)):
        return None
    # Where each value is reached from one side alone, a gap may be a step of the curve.
    low, high = max(up.min(), down.min()), min(up.max(), down.max())
    rising, falling = (int(((v >= low) & (v <= high)).sum()) for v in (up, down))
    return None if min(rising, falling) < limits.FEWEST_ON_A_BRANCH else (rising, falling)


def ways_there(values: Array, noise: float) -> tuple[Array, NDArray[np.intp]]:
    """How a driver came to each point, and the number of the visit; both of shape (n,).

    1 where it last rose, -1 where it fell, 0 where it has not moved yet. A move is one beyond the
    noise and beyond a small share of the driver's range.
    """
    low, high = np.nanquantile(values, [0.02, 0.98])
    least = max(limits.MOVED_SHARE * float(high - low), limits.MOVED_NOISE * noise)
    side, visit = np.zeros(len(values)), np.zeros(len(values), dtype=np.intp)
    last, way, number = np.nan, 0.0, 0
    for i, value in enumerate(values.tolist()):
        if not np.isfinite(last):
            last = value
        elif abs(value - last) > least:
            way, last, number = float(np.sign(value - last)), value, number + 1
        side[i], visit[i] = way, number
    return side, visit


def gap_between(left: Array, way: Array, shared: Array) -> tuple[float, float]:
    """Twice the coefficient of the way there, beside a smooth course, with its standard
    uncertainty.

    `left` and `way` have shape (visits,); `shared`, shape (visits, functions), are functions whose
    amounts are of unit size before. How much visits scatter is found with them.

    Source: Rasmussen and Williams 2006, 2.7 (a Gaussian process with explicit functions).
    """
    fixed = np.stack([way, np.ones(len(way))], axis=1)
    usual = float(np.std(left)) or 1.0
    best = (-np.inf, 0.0, np.inf)
    for scatter in limits.SCATTERS:
        covariance = shared @ shared.T + (scatter * usual) ** 2 * np.eye(len(left))
        inverse = np.linalg.inv(covariance)
        normal = fixed.T @ inverse @ fixed
        doubt = np.linalg.pinv(normal)
        solution = doubt @ (fixed.T @ inverse @ left)
        rest = left - fixed @ solution
        # Restricted: two values were fitted.
        score = -0.5 * float(rest @ inverse @ rest + np.linalg.slogdet(covariance)[1])
        score -= 0.5 * float(np.linalg.slogdet(normal)[1])
        if score > best[0]:
            best = (score, 2.0 * float(solution[0]), 2.0 * float(np.sqrt(doubt[0, 0])))
    return best[1], best[2]
