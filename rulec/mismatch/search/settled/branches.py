"""Does what is left out depend on the way its driver came? Rising and falling compared.

Source: Mayergoyz 2003 (a law with memory has branches).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import TIME, Candidate
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.locate import spot_column, suspect_at
from rulec.mismatch.search.curve_found import Branches, CurveFound
from rulec.mismatch.search.settled.basis import Basis


def branches_of(
    fitted: Fitted, candidate: Candidate, curve: CurveFound, basis: Basis, size: float
) -> Branches | None:
    """The gap between both branches of a place over a driver.

    Visits are what counts, not samples: all samples of one have come the same way. What both
    branches share is found anew beside the gap, as smooth as `basis` with `size` says: a curve that
    was found without a gap has taken some of it. None where there is no common time, or too few
    visits on either branch. `candidate` is the curve as the fit to all points has it.
    """
    data, driver = fitted.rows.system.data, curve.driver
    if not data.timed or driver == TIME:
        return None
    bare = fit(fitted.rows, fitted.setting.leaving(candidate.id), fitted.used, 0)
    column = spot_column(bare, curve.place)
    if column is None:
        return None
    suspect = suspect_at(bare, curve.place, column)
    z, noise = data.values[driver], float(np.nanmedian(data.noise[driver]))
    side, visit = ways_there(z, noise)
    known = (suspect.weight > 0) & fitted.used & np.isfinite(z) & (side != 0)
    if not known.any():
        return None
    # Where the place hardly shows, as that of a pump behind an open relief valve, its course is
    # beyond all sense.
    known &= suspect.weight > limits.HARDLY_SHOWN * np.median(suspect.weight[known])
    number = np.unique(visit[known], return_inverse=True)[1]
    count = np.bincount(number, suspect.weight[known])
    left, at, way = (
        np.bincount(number, v[known] * suspect.weight[known]) / count
        for v in (suspect.course, z, side)
    )
    up, down = at[way > 0], at[way < 0]
    if not (len(up) and len(down)):
        return None
    # Where each value is reached from one side alone, a gap may be a step of the curve.
    low, high = max(up.min(), down.min()), min(up.max(), down.max())
    rising, falling = (int(((v >= low) & (v <= high)).sum()) for v in (up, down))
    if min(rising, falling) < limits.FEWEST_ON_A_BRANCH:
        return None
    gap, u = gap_between(left, way, size * basis.at(at))
    return Branches(gap=gap, u=u, rising=rising, falling=falling)


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
