"""A term without a name as found: its values over its driver, and their uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import TIME, Candidate, CurveTerm, DisturbanceLocation
from rulec.effects.free_form import curve_through
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.screen import spot_column, suspect_at
from rulec.mismatch.result import Rival
from rulec.mismatch.search import limits
from rulec.mismatch.search.evidence import Basis, Switching


@dataclass(frozen=True, kw_only=True)
class Branches:
    """Difference of a place after the driver rose and after it fell, at the same driver.

    `gap` and its standard uncertainty `u` are in SI of the place; `rising` and `falling` count the
    visits.
    """

    gap: float
    u: float
    rising: int
    falling: int


@dataclass(frozen=True)
class RejectedCandidate:
    """An effect in the place of a term: by how much it fits worse, nats, and where.

    `between` are ends of the driver, SI (None: open), that hold the share `share` of that loss;
    None where the loss is spread out.
    """

    candidate: Candidate
    nats: float
    between: tuple[float | None, float | None] | None
    share: float


@dataclass(frozen=True, kw_only=True)
class CurveFound:
    """A term over its driver, SI.

    `at` and `value` have shape (n,), `covariance` (n, n), with all else in the model refitted.
    `means`, shape (m, 3), are driver, value and standard uncertainty of single means. `branches` is
    None where the recording cannot compare them. `elsewhere` are other places at which a term over
    this driver explains about as much, `lost` effects that it beat. `says` is what switches a term
    that comes and goes, or empty.
    """

    place: DisturbanceLocation
    driver: str
    at: Array
    value: Array
    covariance: Array
    means: Array
    branches: Branches | None = None
    elsewhere: tuple[str, ...] = ()
    lost: tuple[RejectedCandidate, ...] = ()
    says: str = ""

    @property
    def terms(self) -> tuple[CurveTerm, ...]:
        """The term that a module type may hold; none if it comes and goes."""
        if self.says or not self.place.may_follow(self.driver):
            return ()
        return (curve_through(self.place.id, self.driver, self.at, self.value),)


@dataclass(frozen=True)
class Accepted:
    """An explanation in the final model, its gain, and the odds of alternatives against it.

    `others` are explanations in its place, each with its odds. `unnamed` are the odds of terms
    without a name, and of nothing; `shapeless` those of curves without a name that contain its law
    as a special case. `curve` describes an explanation without a name. `same` holds, by id, those
    of `others` that predict exactly the same, with the values at which they do, SI by id. `inexact`
    is the probability that errors of laws and sensors alone explain the misfit.
    """

    candidate: Candidate
    gain: float
    others: tuple[tuple[Candidate, float], ...]
    rivals: tuple[Rival, ...]
    unnamed: float = 0.0
    shapeless: float = 0.0
    inexact: float = 0.0
    curve: CurveFound | None = None
    same: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def probability(self) -> float:
        """Against all alternatives, terms without a name and nothing."""
        others = sum(odds for _, odds in self.others)
        return (1.0 - self.inexact) / (1.0 + self.unnamed + self.shapeless + others)

    @property
    def class_probability(self) -> float:
        """Of this explanation or one that shows the same."""
        same = sum(odds for candidate, odds in self.others if candidate.id in self.same)
        return self.probability * (1.0 + same + self.shapeless)


# Does a term depend on whether its driver rose or fell? Both branches compared.
#
# Source: Mayergoyz 2003 (a law with memory has branches).


def enough_visits(
    at: Array, side: Array, visit: NDArray[np.intp], used: NDArray[np.bool_]
) -> tuple[int, int] | None:
    """Count the visits from below and from above in the range reached from both; None if too few.

    `at` is the driver, `side` and `visit` are as in `ways_there`, `used` flags the samples that
    count; all have shape (n,).
    """
    known = used & np.isfinite(at) & (side != 0)
    if not known.any():
        return None
    number = np.unique(visit[known], return_inverse=True)[1]
    count = np.bincount(number)
    mean, way = (np.bincount(number, v[known]) / count for v in (at, side))
    return _counts(mean, way)


def _counts(at: Array, way: Array) -> tuple[int, int] | None:
    """The same by the mean driver and the direction of each visit, shape (visits,)."""
    up, down = at[way > 0], at[way < 0]
    if not (len(up) and len(down)):
        return None
    # Where values are reached from one side only, a gap may be a step of the curve.
    low, high = max(up.min(), down.min()), min(up.max(), down.max())
    rising, falling = (int(((v >= low) & (v <= high)).sum()) for v in (up, down))
    return None if min(rising, falling) < limits.FEWEST_ON_A_BRANCH else (rising, falling)


def ways_there(values: Array, noise: float) -> tuple[Array, NDArray[np.intp]]:
    """Direction from which a driver reached each point, and the number of the visit; shape (n,).

    The direction is 1 after a rise, -1 after a fall, 0 before the first move. A move exceeds both
    the noise and a small share of the driver's range.
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
    """Gap between both branches beside a smooth course, and its standard uncertainty.

    `left` and `way` have shape (visits,). `shared`, shape (visits, functions), are functions whose
    amounts have a unit prior. The scatter of the visits is estimated along with them.

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
        # Restricted likelihood: two values were fitted.
        score = -0.5 * float(rest @ inverse @ rest + np.linalg.slogdet(covariance)[1])
        score -= 0.5 * float(np.linalg.slogdet(normal)[1])
        if score > best[0]:
            best = (score, 2.0 * float(solution[0]), 2.0 * float(np.sqrt(doubt[0, 0])))
    return best[1], best[2]


def branches_of(
    fitted: Fitted, candidate: Candidate, curve: CurveFound, basis: Basis | Switching, size: float
) -> Branches | None:
    """Gap between the branches of a place over a driver; None without a clock or enough visits.

    Visits count, not samples, as all samples of a visit came the same way. The course that both
    branches share is refitted beside the gap with the prior of `basis` and `size`: a curve found
    without a gap has absorbed part of it. `candidate` is the curve in the fit to all points.
    """
    data, driver = fitted.rows.system.data, curve.driver
    if not data.timed or driver == TIME:
        return None
    bare = fit(fitted.rows, fitted.setting.leaving(candidate.id), fitted.used, 0)
    column = spot_column(bare, curve.place)
    if column is None:
        return None
    suspect = suspect_at(bare, curve.place, column)
    z = data.values[driver]
    side, visit = ways_there(z, float(np.nanmedian(data.noise[driver])))
    known = (suspect.weight > 0) & fitted.used & np.isfinite(z) & (side != 0)
    if not known.any():
        return None
    # Where the place hardly shows (a pump behind an open relief valve), its course is meaningless.
    known &= suspect.weight > limits.HARDLY_SHOWN * np.median(suspect.weight[known])
    number = np.unique(visit[known], return_inverse=True)[1]
    count = np.bincount(number, suspect.weight[known])
    left, at, way = (
        np.bincount(number, v[known] * suspect.weight[known]) / count
        for v in (suspect.course, z, side)
    )
    counts = _counts(at, way)
    if counts is None:
        return None
    gap, u = gap_between(left, way, size * basis.at(at))
    return Branches(gap=gap, u=u, rising=counts[0], falling=counts[1])
