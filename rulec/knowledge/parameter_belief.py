"""The prior of parameters before a recording, shared by all fits.

The prior of a parameter lies where its data sheet states it or, once calibrated, where the
calibration found it. The sheet then covers the case that the calibration does not hold, for example
because its law left something out. Priors of positive parameters are priors of their logarithms, so
that no sign changes. All are Student distributions: a recording moves values as far as it informs
about them, and leaves the others. No prior is ever dropped.

Source: Lange, Little, Taylor 1989 (the t distribution); JCGM 100 (GUM), 4.3 (prior knowledge).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.knowledge.limits import CALIBRATION_FAILS
from rulec.limits import BELIEF_FREEDOM, STRAINED, UNBELIEVABLE


def peak_of(freedom: Array) -> Array:
    """Log density of Student distributions at their centre, minus that of normals of equal scale.

    >>> peak_of(np.array([3.0])).round(3)
    array([-0.082])
    """
    # From the standard library, so that reporting a strain does not need scipy.
    of = np.vectorize(math.lgamma, otypes=[float])
    known = of((freedom + 1) / 2) - of(freedom / 2)
    return np.asarray(known - 0.5 * np.log(0.5 * freedom))


_PEAK = peak_of(np.asarray(BELIEF_FREEDOM))


@dataclass(frozen=True)
class Coordinates:
    """Coordinates of a fit: logarithms of positive values; `positive` has shape (n,).

    >>> z = Coordinates(np.array([True, False]))
    >>> z.of(np.array([1.0, -2.0])), z.values(np.array([0.0, -2.0]))
    (array([ 0., -2.]), array([ 1., -2.]))
    """

    positive: np.ndarray

    def of(self, values: Array) -> Array:
        """Coordinates of values, shape (n,)."""
        return np.where(self.positive, np.log(np.where(self.positive, values, 1.0)), values)

    def values(self, at: Array) -> Array:
        """Values at coordinates, shape (n,)."""
        return np.where(self.positive, np.exp(np.where(self.positive, at, 0.0)), at)

    def slopes(self, at: Array) -> Array:
        """Derivatives of the values with respect to the coordinates, shape (n,)."""
        return np.where(self.positive, self.values(at), 1.0)

    def scales(self, values: Array, u: Array) -> Array:
        """Standard uncertainties of the coordinates, shape (n,).

        That of a logarithm gives the log-normal value its relative uncertainty.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.sqrt(np.log1p((u / values) ** 2))
        return np.where(self.positive, relative, u)


@dataclass(frozen=True)
class _Stated:
    """A statement on k parameters: `mean`, shape (k,), and `precision`, shape (k, k), in
    coordinates, with the log odds that it holds."""

    mean: Array
    precision: Array
    odds: float

    @cached_property
    def _ways(self) -> tuple[Array, Array, Array]:
        """Square roots of the precisions, then weights and directions of independent axes."""
        size = np.sqrt(np.diag(self.precision))
        parts, ways = np.linalg.eigh(self.precision / np.outer(size, size))
        return size, np.maximum(parts, 1e-12), ways

    def density(self, at: Array) -> tuple[float, Array]:
        """Log density, without the constant of a normal distribution, and the precision there."""
        size, parts, ways = self._ways
        far = parts * (ways.T @ (size * (at - self.mean))) ** 2
        tails = 0.5 * (BELIEF_FREEDOM + 1.0) * float(np.sum(np.log1p(far / BELIEF_FREEDOM)))
        weight = parts * (BELIEF_FREEDOM + 1.0) / (BELIEF_FREEDOM + far)
        return self.peak - tails, (ways * weight) @ ways.T * np.outer(size, size)

    @cached_property
    def peak(self) -> float:
        """Largest log density, with the odds."""
        size, parts, _ = self._ways
        whole = float(np.sum(np.log(size)) + 0.5 * np.sum(np.log(parts)))
        return whole + float(_PEAK) * len(parts) + self.odds

    def strains(self, at: Array) -> tuple[Array, Array]:
        """Rows, shape (k,), and their slopes, shape (k, k).

        Half of the sum of their squares is the fall of the log density from its peak.
        """
        size, parts, ways = self._ways
        turned = np.sqrt(parts)[:, None] * ways.T * size
        far = turned @ (at - self.mean)
        squares = (BELIEF_FREEDOM + 1.0) * np.log1p(far**2 / BELIEF_FREEDOM)
        rows = np.copysign(np.sqrt(squares), far)
        steep = np.full(len(far), np.sqrt((BELIEF_FREEDOM + 1.0) / BELIEF_FREEDOM))
        off = np.abs(far) > 1e-6
        steep[off] *= far[off] / rows[off] * steep[off] / (1.0 + far[off] ** 2 / BELIEF_FREEDOM)
        return rows, steep[:, None] * turned


@dataclass(frozen=True)
class _Part:
    """Parameters with a joint prior: their indices, and the statements on them."""

    places: np.ndarray
    stated: tuple[_Stated, ...]

    @property
    def is_alone(self) -> bool:
        return len(self.places) == 1 and len(self.stated) == 1

    def holding(self, at: Array) -> tuple[_Stated, float, Array]:
        """The most probable statement there, with its log density and precision."""
        every = [(s, *s.density(at[self.places])) for s in self.stated]
        return max(every, key=lambda one: one[1])


@dataclass(frozen=True)
class LocalBelief:
    """A prior near a point: its log density, and the normal distribution of the same slope there.

    `mean` has shape (n,), `precision` (n, n), both in coordinates.
    """

    density: float
    mean: Array
    precision: Array


@dataclass(frozen=True)
class Belief:
    """The prior of the parameters `names`; arrays are in this order, values in SI."""

    names: tuple[str, ...]
    coordinates: Coordinates
    parts: tuple[_Part, ...]

    def near(self, at: Array) -> LocalBelief:
        """The prior near some coordinates, shape (n,)."""
        n = len(self.names)
        mean, precision = np.zeros(n), np.zeros((n, n))
        places, means, scales, peak = self._alone
        far = (scales * (at[places] - means)) ** 2
        density = peak - 0.5 * (BELIEF_FREEDOM + 1.0) * float(
            np.sum(np.log1p(far / BELIEF_FREEDOM))
        )
        mean[places] = means
        weight = (BELIEF_FREEDOM + 1.0) / (BELIEF_FREEDOM + far)
        precision[places, places] = scales**2 * weight
        for part in self.parts:
            if part.is_alone:
                continue
            stated, own, there = part.holding(at)
            density += own
            mean[part.places] = stated.mean
            precision[np.ix_(part.places, part.places)] = there
        return LocalBelief(density, mean, precision)

    @cached_property
    def _alone(self) -> tuple[np.ndarray, Array, Array, float]:
        """Parameters stated alone and once: indices, means, inverse scales, largest log density."""
        own = [part for part in self.parts if part.is_alone]
        stated = [part.stated[0] for part in own]
        return (
            np.array([int(part.places[0]) for part in own], dtype=np.intp),
            np.array([float(one.mean[0]) for one in stated]),
            np.array([float(np.sqrt(one.precision[0, 0])) for one in stated]),
            float(sum(one.peak for one in stated)),
        )

    def strains(self, at: Array) -> tuple[Array, Array]:
        """The prior as rows of a least-squares fit, and their slopes, shapes (r,), (r, n).

        Half of the sum of their squares is the fall of the log density from its peak.
        """
        rows, slopes = np.zeros(self.rows), np.zeros((self.rows, len(self.names)))
        first = 0
        for part in self.parts:
            stated, last = part.holding(at)[0], first + len(part.places)
            rows[first:last], slopes[first:last, part.places] = stated.strains(at[part.places])
            rows[last] = np.sqrt(2.0 * (max(s.peak for s in part.stated) - stated.peak))
            first = last + 1
        return rows, slopes

    @property
    def rows(self) -> int:
        """Number of rows of `strains`."""
        return len(self.names) + len(self.parts)

    @property
    def mean(self) -> Array:
        """Mean of the prior, in coordinates, shape (n,)."""
        return self.near(self._means(0)).mean

    @property
    def by_sheet(self) -> LocalBelief:
        """The prior if no calibration holds."""
        return self.near(self._means(-1))

    def _means(self, which: int) -> Array:
        at = np.zeros(len(self.names))
        for part in self.parts:
            at[part.places] = part.stated[which].mean
        return at


def belief_in(
    names: Sequence[str],
    positive: np.ndarray,
    values: Array,
    covariance: Array,
    sheet: Mapping[str, tuple[float, float]],
) -> Belief:
    """The prior of uncertain parameters.

    Parameters
    ----------
    names : shape (n,).
    positive : shape (n,); which of them are always positive.
    values, covariance : from the calibration, or else the sheet; shapes (n,), (n, n), SI.
    sheet : value and standard uncertainty from the data sheet; parameters that differ from it were
        calibrated.
    """
    own = Coordinates(positive)
    u = np.sqrt(np.diag(covariance))
    scale = own.scales(values, u)
    correlation = covariance / np.outer(u, u)
    at = own.of(values)
    stated = [sheet.get(name, (0.0, 0.0)) for name in names]
    of_sheet = np.array([value for value, _ in stated])
    u_sheet = np.array([uncertain for _, uncertain in stated])
    calibrated = ~(np.isclose(of_sheet, values, rtol=1e-12, atol=0.0) & np.isclose(u_sheet, u))
    calibrated &= u_sheet > 0.0
    sheet_at = own.of(np.where(calibrated, of_sheet, values))
    sheet_scale = own.scales(np.where(calibrated, of_sheet, values), u_sheet)
    parts = []
    for places in _together(correlation):
        inverse = np.linalg.inv(correlation[np.ix_(places, places)] + 1e-9 * np.eye(len(places)))
        found = _Stated(at[places], inverse / np.outer(scale[places], scale[places]), 0.0)
        if not calibrated[places].any():
            parts.append(_Part(places, (found,)))
            continue
        wide = np.where(calibrated, sheet_scale, scale)[places]
        known = _Stated(sheet_at[places], np.diag(wide**-2.0), float(np.log(CALIBRATION_FAILS)))
        parts.append(_Part(places, (found, known)))
    return Belief(tuple(names), own, tuple(parts))


def _together(correlation: Array) -> list[np.ndarray]:
    """Indices of parameters that are correlated, directly or through others."""
    left, found = list(range(len(correlation))), []
    while left:
        places = [left[0]]
        for i in places:
            places += [j for j in left if j not in places and correlation[i, j] != 0.0]
        left = [i for i in left if i not in places]
        found.append(np.array(sorted(places)))
    return found


@dataclass(frozen=True)
class Strain:
    """A parameter far from its data sheet, or from another source (`by`); numbers in `unit`.

    >>> print(Strain("V.Kv", 6.8, 33.0, 6.0, "m3/h"))
    V.Kv 6.8 m3/h, sheet 33 ± 6: 4.4 u
    """

    parameter: str
    value: float
    stated: float
    u: float
    unit: str = ""
    by: str = "sheet"

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        value, stated, u = (f"{n:.3g}" for n in (self.value, self.stated, self.u))
        return f"{self.parameter} {value}{unit}, {self.by} {stated} ± {u}: {self.distance:.1f} u"

    @property
    def distance(self) -> float:
        """Distance from the sheet, in standard uncertainties of the sheet."""
        return abs(self.value - self.stated) / self.u

    @property
    def is_believable(self) -> bool:
        """Whether the distance is still credible."""
        return self.distance <= UNBELIEVABLE


def strain_of(
    values: Mapping[str, float],
    sheet: Mapping[str, tuple[float, float]],
    units: Mapping[str, tuple[str, float]],
) -> tuple[Strain, ...]:
    """Parameters far from their sheet (value and standard uncertainty), the farthest first.

    `values` and `sheet` are in SI; `units` gives the unit for display and its factor.

    >>> sheet, unit = {"V.Kv": (33.0, 6.0), "V.k": (1.1, 0.1)}, ("m3/h", 1.0)
    >>> far = strain_of({"V.Kv": 6.8, "V.k": 1.0}, sheet, {"V.Kv": unit, "V.k": unit})
    >>> [(strain.parameter, round(strain.distance, 1)) for strain in far]
    [('V.Kv', 4.4)]
    """
    found = []
    for name, (stated, u) in sheet.items():
        unit, factor = units[name]
        if u > 0.0 and name in values:
            value = values[name] / factor
            found.append(Strain(name, value, stated / factor, u / factor, unit))
    far = [strain for strain in found if strain.distance > STRAINED]
    return tuple(sorted(far, key=lambda strain: -strain.distance))
