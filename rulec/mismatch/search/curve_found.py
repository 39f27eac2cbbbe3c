"""A term without a name as found: its values over its driver, and their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, CurveTerm, DisturbanceLocation
from rulec.effects.free_form import curve_through


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

    @property
    def u(self) -> Array:
        """Standard uncertainty of each value, shape (n,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))
