"""What is known of parameters before a recording: one belief, wherever values are fitted.

A parameter is believed to lie where its data sheet states it or, once calibrated, where the
calibration found it; then the sheet counts for the case that the calibration does not hold, as one
made with a law that left something out. Positive parameters are believed in their logarithms: none
changes its sign. Both are Student distributions: a recording moves a value as far as it sees it,
and leaves the rest where it was. No belief is ever dropped.

Source: Lange, Little, Taylor 1989 (the t distribution); JCGM 100 (GUM), 4.3 (what is known before).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.limits import BELIEF_FREEDOM, CALIBRATION_FAILS, STRAINED, UNBELIEVABLE


def peak_of(freedom: Array) -> Array:
    """Log density at the centre of Student distributions, less that of normal ones of their scale.

    >>> peak_of(np.array([3.0])).round(3)
    array([-0.082])
    """
    # Of the standard library: who only tells a strain needs no scipy.
    of = np.vectorize(math.lgamma, otypes=[float])
    known = of((freedom + 1) / 2) - of(freedom / 2)
    return np.asarray(known - 0.5 * np.log(0.5 * freedom))


_PEAK = peak_of(np.asarray(BELIEF_FREEDOM))


@dataclass(frozen=True)
class Coordinates:
    """Numbers in which values are fitted: logarithms of positive ones; `positive` has shape (n,).

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
        """Slopes of the values by the coordinates, shape (n,)."""
        return np.where(self.positive, self.values(at), 1.0)

    def scales(self, values: Array, u: Array) -> Array:
        """Standard uncertainties of the coordinates, shape (n,).

        That of a logarithm is the one with which a log-normal value has the relative uncertainty.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.sqrt(np.log1p((u / values) ** 2))
        return np.where(self.positive, relative, u)


@dataclass(frozen=True)
class _Stated:
    """One statement on some parameters: `mean`, shape (k,), and `precision`, shape (k, k), in
    coordinates, with the log odds that it is the one that holds."""

    mean: Array
    precision: Array
    odds: float

    @cached_property
    def _ways(self) -> tuple[Array, Array, Array]:
        """Sizes of the parameters, and independent directions with their weights."""
        size = np.sqrt(np.diag(self.precision))
        parts, ways = np.linalg.eigh(self.precision / np.outer(size, size))
        return size, np.maximum(parts, 1e-12), ways

    def density(self, at: Array) -> tuple[float, Array]:
        """Log density (that of a normal one without its constant), and the precision there."""
        size, parts, ways = self._ways
        far = parts * (ways.T @ (size * (at - self.mean))) ** 2
        tails = 0.5 * (BELIEF_FREEDOM + 1.0) * float(np.sum(np.log1p(far / BELIEF_FREEDOM)))
        weight = parts * (BELIEF_FREEDOM + 1.0) / (BELIEF_FREEDOM + far)
        return self.peak - tails, (ways * weight) @ ways.T * np.outer(size, size)

    @cached_property
    def peak(self) -> float:
        """Log density where it is largest, with the odds."""
        size, parts, _ = self._ways
        whole = float(np.sum(np.log(size)) + 0.5 * np.sum(np.log(parts)))
        return whole + float(_PEAK) * len(parts) + self.odds

    def strains(self, at: Array) -> tuple[Array, Array]:
        """Rows, shape (k,), half of whose squares is what the density falls by from its peak, and
        their slopes, shape (k, k)."""
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
    """Parameters believed together: their places, and what is stated of them."""

    places: np.ndarray
    stated: tuple[_Stated, ...]

    @property
    def is_alone(self) -> bool:
        """Is it one parameter, stated once?"""
        return len(self.places) == 1 and len(self.stated) == 1

    def holding(self, at: Array) -> tuple[_Stated, float, Array]:
        """The statement that is the most probable there, its log density and precision."""
        every = [(s, *s.density(at[self.places])) for s in self.stated]
        return max(every, key=lambda one: one[1])


@dataclass(frozen=True)
class LocalBelief:
    """A belief near a place: its log density, and the normal distribution that has its slope and
    weight there, `mean` of shape (n,), `precision` of shape (n, n), in coordinates."""

    density: float
    mean: Array
    precision: Array


@dataclass(frozen=True)
class Belief:
    """What is known of the parameters `names`; arrays are in this order, values in SI."""

    names: tuple[str, ...]
    coordinates: Coordinates
    parts: tuple[_Part, ...]

    def near(self, at: Array) -> LocalBelief:
        """The belief near some coordinates, shape (n,)."""
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
        for part in self._joint:
            stated, own, there = part.holding(at)
            density += own
            mean[part.places] = stated.mean
            precision[np.ix_(part.places, part.places)] = there
        return LocalBelief(density, mean, precision)

    @cached_property
    def _alone(self) -> tuple[np.ndarray, Array, Array, float]:
        """Places of parameters that are stated alone, and once; their means, one over their
        scales, and the log density where that is largest."""
        own = [part for part in self.parts if part.is_alone]
        stated = [part.stated[0] for part in own]
        return (
            np.array([int(part.places[0]) for part in own], dtype=np.intp),
            np.array([float(one.mean[0]) for one in stated]),
            np.array([float(np.sqrt(one.precision[0, 0])) for one in stated]),
            float(sum(one.peak for one in stated)),
        )

    @cached_property
    def _joint(self) -> tuple[_Part, ...]:
        """All others."""
        return tuple(part for part in self.parts if not part.is_alone)

    def strains(self, at: Array) -> tuple[Array, Array]:
        """The belief as rows of a least-squares fit, and their slopes, shapes (r,), (r, n).

        Half of their squares is what the log density falls by from its peak.
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
        """Number of such rows."""
        return len(self.names) + len(self.parts)

    @property
    def mean(self) -> Array:
        """Where the parameters are believed to lie, in coordinates, shape (n,)."""
        return self.near(self._means(0)).mean

    @property
    def by_sheet(self) -> LocalBelief:
        """What is believed where no calibration holds."""
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
    """The belief in parameters with an uncertainty.

    Parameters
    ----------
    names : shape (n,).
    positive : shape (n,); which of them have no other sign.
    values, covariance : by calibration, or else by the sheet; shapes (n,), (n, n), SI.
    sheet : value and standard uncertainty by the data sheet; what differs from it was calibrated.
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
    """Places of parameters that are stated together."""
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
    """A parameter that lies far from its data sheet, in `unit`; of what else states it, `by`.

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
        """How far it is off, in standard uncertainties of the sheet."""
        return abs(self.value - self.stated) / self.u

    @property
    def is_believable(self) -> bool:
        """Would anybody believe it?"""
        return self.distance <= UNBELIEVABLE


def strain_of(
    values: Mapping[str, float],
    sheet: Mapping[str, tuple[float, float]],
    units: Mapping[str, tuple[str, float]],
) -> tuple[Strain, ...]:
    """Parameters far from their sheet, value and standard uncertainty, the farthest first.

    `values` and `sheet` are in SI; `units` have the unit in which each is told, and its factor.

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
