"""Does what is left out depend on the way its driver came? Rising and falling compared.

Source: Mayergoyz 2003 (a law with memory has branches).
"""

from __future__ import annotations

import numpy as np

from rulec.effects.candidate import TIME, Candidate
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.locate import spot_column, suspect_at
from rulec.mismatch.search import limits
from rulec.mismatch.search.branches import gap_between, visits_on_branches, ways_there
from rulec.mismatch.search.curve_found import Branches, CurveFound
from rulec.mismatch.search.evidence import Functions


def branches_of(
    fitted: Fitted, candidate: Candidate, curve: CurveFound, basis: Functions, size: float
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
    counts = visits_on_branches(at, way)
    if counts is None:
        return None
    gap, u = gap_between(left, way, size * basis.at(at))
    return Branches(gap=gap, u=u, rising=counts[0], falling=counts[1])
