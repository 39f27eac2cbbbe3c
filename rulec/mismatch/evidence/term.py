"""Terms without a name: a place that follows a driver by any smooth function, or that switches."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import DisturbanceLocation
from rulec.mismatch.evidence import limits

KNOTS = np.linspace(0.0, 1.0, 41)
"""Shares of a driver's range at which functions are tabulated; they are linear in between."""


@dataclass(frozen=True)
class Basis:
    """Functions of a driver from `low` to `high`, constant beyond these ends.

    `length` is their correlation length as a share of that range; `says` is empty, as nothing
    switches them, and `penalty` zero, as nothing more has to be specified.
    """

    low: float
    high: float
    length: float
    says: str = ""
    penalty: float = 0.0

    def at(self, values: Array) -> Array:
        """Independent functions of unit prior size at values, shape (n, functions)."""
        z = (values - self.low) / max(self.high - self.low, 1e-300)
        table = _functions(self.length)
        return np.stack([np.interp(z, KNOTS, column) for column in table.T], axis=1)


@cache
def _functions(length: float) -> Array:
    """The functions at the knots, shape (knots, functions), by falling variance."""
    apart = (KNOTS[:, None] - KNOTS[None, :]) ** 2
    size, ways = np.linalg.eigh(1.0 + np.exp(-0.5 * apart / length**2))
    rank = int((size > limits.FORM_RANK * size.max()).sum())
    best = np.argsort(-size)[: min(rank, limits.TERM_FUNCTIONS)]
    return np.asarray(ways[:, best] * np.sqrt(size[best]))


def basis_over(values: Array, length: float) -> Basis:
    """The basis over the range of a driver without its outermost values, shape (n,)."""
    low, high = np.nanquantile(values, [0.02, 0.98])
    return Basis(float(low), float(high), length)


@dataclass(frozen=True)
class Switching:
    """A function of time, s: `level`, shape (m + 1,), before and after each of `ends`, shape (m,).

    `says` is what switches it, `penalty` the cost of specifying its ends, nats.
    """

    ends: Array
    level: Array
    says: str
    penalty: float
    length: float = 0.0

    def at(self, time: Array) -> Array:
        """The function at times, shape (n, 1)."""
        return np.asarray(self.level[np.searchsorted(self.ends, time, side="right")][:, None])


@dataclass(frozen=True)
class Term:
    """A change at a place that follows a driver by a law without a name.

    `location` is the id of the place; `changed` is that place or a parameter of its law. `slopes`,
    shape (open rows,), are those of the residuals by `changed`, SI. `columns`, shape (open rows,
    functions), are the effects of the functions of `basis` on the residuals, over their `norm`;
    their size is estimated along with the errors of form. At a reading, sizes above the `usual`
    one, in the same units, are improbable by the geometric standard deviation `factor`.
    """

    name: str
    location: str
    changed: DisturbanceLocation
    driver: str
    slopes: Array
    basis: Basis | Switching
    norm: float
    columns: Array
    usual: float = float("inf")
    factor: float = 1.0

    def odds(self, size: float) -> float:
        """Log prior density of a size, relative to that of a usual one."""
        if size <= self.usual:
            return 0.0
        return -0.5 * float(np.log(size / self.usual) / np.log(self.factor)) ** 2


def term_with(
    columns: Array,
    location: str,
    changed: DisturbanceLocation,
    driver: str,
    basis: Basis | Switching,
    slopes: Array,
) -> Term | None:
    """A term with `columns` before they are divided by their norm; None where it does not show."""
    norm = float(np.sqrt(np.mean(columns[:, 0] ** 2)))
    if not (norm > 0.0 and np.isfinite(columns).all()):
        return None
    name = f"{changed.id}~{driver}"
    return Term(name, location, changed, driver, slopes, basis, norm, columns / norm)


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


def bends(driver: Array) -> tuple[Array, ...]:
    """A parabola and a cubic over the range of a driver, of unit size."""
    low, high = np.quantile(driver, [0.02, 0.98])
    if high <= low:
        return ()
    z = np.clip(2.0 * (driver - low) / (high - low) - 1.0, -1.2, 1.2)
    return np.sqrt(5.0) * (3.0 * z**2 - 1.0) / 4.0, np.sqrt(7.0) * (5.0 * z**3 - 3.0 * z) / 4.0
