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

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.knowledge.limits import CALIBRATION_FAILS
from rulec.limits import BELIEF_FREEDOM, STRAINED, UNBELIEVABLE


def peak_of(freedom: Array) -> Array:
    """Log density of Student distributions at their centre, minus that of normals of equal scale.

    >>> peak_of(np.array([3.0])).round(3)
    array([-0.082])
    """
    # From the standard library: to report a strain needs no scipy.
    of = np.vectorize(math.lgamma, otypes=[float])
    norm = of((freedom + 1) / 2) - of(freedom / 2)
    return np.asarray(norm - 0.5 * np.log(0.5 * freedom))


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
    """A statement on all n parameters, in coordinates: their `mean`, shape (n,), and `axes`, shape
    (n, n), along which distances are independent and in standard uncertainties.

    `peak` holds the largest log density of each part, with the log odds that the statement holds
    there, without the constant of a normal distribution.
    """

    mean: Array
    axes: Array
    peak: Array


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
    """The prior of the parameters `names`; arrays are in this order, values in SI.

    Parameters of the same `part`, shape (n,), are correlated: for them, one of the two statements
    holds, by the calibration or by the sheet.
    """

    names: tuple[str, ...]
    coordinates: Coordinates
    part: np.ndarray
    by_calibration: _Stated
    by_data_sheet: _Stated

    def near(self, at: Array) -> LocalBelief:
        """The prior near some coordinates, shape (n,)."""
        stated, far, density = self._holding(at)
        weight = (BELIEF_FREEDOM + 1.0) / (BELIEF_FREEDOM + far**2)
        precision = (stated.axes.T * weight) @ stated.axes
        return LocalBelief(float(np.sum(density)), stated.mean, precision)

    def strains(self, at: Array) -> tuple[Array, Array]:
        """The prior as rows of a least-squares fit, and their slopes, shapes (r,), (r, n).

        Half of the sum of their squares is the fall of the log density from its peak.
        """
        stated, far, _ = self._holding(at)
        rows = np.copysign(np.sqrt(2.0 * _fall(far)), far)
        steep = np.full(len(far), np.sqrt((BELIEF_FREEDOM + 1.0) / BELIEF_FREEDOM))
        off = np.abs(far) > 1e-6
        steep[off] *= far[off] / rows[off] * steep[off] / (1.0 + far[off] ** 2 / BELIEF_FREEDOM)
        highest = np.maximum(self.by_calibration.peak, self.by_data_sheet.peak)
        of_parts = np.sqrt(2.0 * (highest - stated.peak))
        slopes = np.zeros((self.rows, len(far)))
        slopes[: len(far)] = steep[:, None] * stated.axes
        return np.concatenate([rows, of_parts]), slopes

    def _holding(self, at: Array) -> tuple[_Stated, Array, Array]:
        """The more probable statement on each part, the distances along its axes, shape (n,), and
        the log density of each part."""
        one, other = self.by_calibration, self.by_data_sheet
        far = [s.axes @ (at - s.mean) for s in (one, other)]
        density = [
            s.peak - np.bincount(self.part, _fall(f), len(s.peak))
            for s, f in zip((one, other), far, strict=True)
        ]
        fails = density[1] > density[0]
        own = fails[self.part]
        stated = _Stated(
            np.where(own, other.mean, one.mean),
            np.where(own[:, None], other.axes, one.axes),
            np.where(fails, other.peak, one.peak),
        )
        return stated, np.where(own, far[1], far[0]), np.maximum(*density)

    @property
    def rows(self) -> int:
        """Number of rows of `strains`."""
        return len(self.names) + len(self.by_calibration.peak)

    @property
    def mean(self) -> Array:
        """Mean of the prior, in coordinates, shape (n,)."""
        return self.near(self.by_calibration.mean).mean

    @property
    def by_sheet(self) -> LocalBelief:
        """The prior if no calibration holds."""
        return self.near(self.by_data_sheet.mean)


def _fall(far: Array) -> Array:
    """Fall of the log density of a Student distribution at a distance from its centre."""
    return np.asarray(0.5 * (BELIEF_FREEDOM + 1.0) * np.log1p(far**2 / BELIEF_FREEDOM))


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
    from scipy.sparse.csgraph import connected_components  # to report a strain needs no scipy

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
    wide = np.where(calibrated, sheet_scale, scale)
    count, part = connected_components(correlation)
    axes, peak = (np.zeros_like(correlation), np.diag(1.0 / wide)), np.zeros((2, count))
    for k in range(count):
        indices = np.flatnonzero(part == k)
        block = np.ix_(indices, indices)
        inverse = np.linalg.inv(correlation[block] + 1e-9 * np.eye(len(indices)))
        axes[0][block] = _axes(inverse / np.outer(scale[indices], scale[indices]))
        odds = math.log(CALIBRATION_FAILS) if calibrated[indices].any() else -math.inf
        for which, its_odds in enumerate((0.0, odds)):
            size = float(np.linalg.slogdet(axes[which][block])[1])
            peak[which, k] = size + float(_PEAK) * len(indices) + its_odds
    calibration = _Stated(at, axes[0], peak[0])
    return Belief(tuple(names), own, part, calibration, _Stated(sheet_at, axes[1], peak[1]))


def _axes(precision: Array) -> Array:
    """Directions as rows, along which distances are independent and in standard uncertainties."""
    size = np.sqrt(np.diag(precision))
    parts, ways = np.linalg.eigh(precision / np.outer(size, size))
    axes: Array = np.sqrt(np.maximum(parts, 1e-12))[:, None] * ways.T * size
    return axes


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
