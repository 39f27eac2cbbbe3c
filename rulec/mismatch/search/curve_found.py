"""What a term without a name was found to be: its values over its driver, and how sure they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, Spot


@dataclass(frozen=True, kw_only=True)
class Branches:
    """What a place shows more after the driver rose than after it fell, at the same driver.

    `gap` and its standard uncertainty `u` are in SI of the place; `rising` and `falling` count the
    visits behind it.
    """

    gap: float
    u: float
    rising: int
    falling: int


@dataclass(frozen=True)
class RejectedCandidate:
    """An effect that is in the place of a term: by how much it fits worse, nats; and where.

    `between` are ends of the driver, SI (None: open), that hold the share `share` of that; None
    where it lies everywhere.
    """

    candidate: Candidate
    nats: float
    between: tuple[float | None, float | None] | None
    share: float


@dataclass(frozen=True, kw_only=True)
class CurveFound:
    """A term over its driver, SI.

    `at` and `value` have shape (n,), `covariance` (n, n), everything else in the model refitted.
    `means`, shape (m, 3), are driver, value and standard uncertainty of what single means show.
    `branches` is None where nothing tells whether the way there matters. `elsewhere` are
    other places at which a term over this driver explains about as much, `lost` effects that could
    stand in its place. `says` is what switches a term that comes and goes, or empty.
    """

    place: Spot
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
    def u(self) -> Array:
        """Standard uncertainty of each value, shape (n,)."""
        u: Array = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return u
