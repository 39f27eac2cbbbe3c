"""A term without a name as found: its values over its driver, and their uncertainty."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, CurveTerm, DisturbanceLocation
from rulec.effects.free_form import curve_through
from rulec.mismatch.result import Rival
from rulec.mismatch.search import limits


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
    `means`, shape (m, 3), are driver, value and standard uncertainty of single means at settled
    points. `branches` is None where the recording cannot compare them. `elsewhere` are other places
    at which a term over this driver explains about as much, `lost` effects that it beat. `says` is
    what switches a term that comes and goes, or empty.
    """

    location: DisturbanceLocation
    driver: str
    at: Array
    value: Array
    covariance: Array
    means: Array = field(default_factory=lambda: np.zeros((0, 3)))
    branches: Branches | None = None
    elsewhere: tuple[str, ...] = ()
    lost: tuple[RejectedCandidate, ...] = ()
    says: str = ""

    @property
    def terms(self) -> tuple[CurveTerm, ...]:
        """The term that a module type may hold; none if it comes and goes."""
        if self.says or not self.location.may_follow(self.driver):
            return ()
        return (curve_through(self.location.id, self.driver, self.at, self.value),)


@dataclass(frozen=True)
class Accepted:
    """An explanation in the final model, its gain, and the odds of alternatives against it.

    `others` are explanations in its place, each with its odds. `unnamed` are the odds of terms
    without a name, and of nothing; `shapeless` those of curves without a name that contain its law
    as a special case. `curve` describes an explanation without a name. `same` are ids of those of
    `others` that predict exactly the same. `inexact` is the probability that errors of laws and
    sensors alone explain the misfit.
    """

    candidate: Candidate
    gain: float
    others: tuple[tuple[Candidate, float], ...]
    rivals: tuple[Rival, ...]
    unnamed: float = 0.0
    shapeless: float = 0.0
    inexact: float = 0.0
    curve: CurveFound | None = None
    same: frozenset[str] = frozenset()

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


def means_of_visits(
    visit: NDArray[np.intp], used: np.ndarray, weight: Array, *courses: Array
) -> Iterator[Array]:
    """Weighted means of courses over each visit, shape (visits,), by the `used` samples.

    The number of the `visit` of each, its weight and the courses have shape (n,)."""
    number = np.unique(visit[used], return_inverse=True)[1]
    count = np.bincount(number, weight[used])
    for course in courses:
        yield np.bincount(number, course[used] * weight[used]) / count


def counted_visits(at: Array, way: Array) -> tuple[int, int] | None:
    """The number of visits from below and from above in the range reached from both, by the mean
    driver and the direction of each visit, shape (visits,); None if these are too few."""
    up, down = at[way > 0], at[way < 0]
    if not (len(up) and len(down)):
        return None
    # Where values are reached from one side only, a gap may be a step of the curve.
    low, high = max(up.min(), down.min()), min(up.max(), down.max())
    rising, falling = (int(((v >= low) & (v <= high)).sum()) for v in (up, down))
    return None if min(rising, falling) < limits.FEWEST_ON_A_BRANCH else (rising, falling)
