"""The interface between the search and a recording of any plant: rows, and allowed model errors.

A model is linearised at its values: its residual, shape (rows,), is r = r0 + J_theta d_theta +
J_w w + J_b b + J_c c + noise. Values of the plant and of joined candidates have lasting priors.
Errors of sensors within their class (b) and errors of form of each law within its accuracy (c) are
random columns, which are integrated out. The slopes are those of operating points at settled
points, and those of a simulation in plants that store; the search need not know which.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Protocol

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.special import stdtr, stdtrit

from rulec.effects.candidate import Candidate, DisturbanceLocation, Unknown
from rulec.knowledge.knowledge import has_no_zero
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Prior
from rulec.mismatch.evidence.steady.screen import references, starts
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.search import limits


@dataclass(frozen=True)
class Size:
    """Prior of the distance of an amplitude from its null.

    A Student distribution about the `usual` size with a `width`, infinite where none is stated, and
    `freedom`. `scale` is that of a Student distribution about the null whose median distance is
    the usual one; its tail falls as that of the log-normal distribution at two standard deviations.
    """

    scale: float
    freedom: float
    usual: float = 0.0
    width: float = float("inf")


def log_inside(size: Size, unknown: Unknown) -> float:
    """Logarithm of the prior share of amplitudes within the range of an unknown; both signs are
    equally likely."""
    null = unknown.null or 0.0
    ends = np.array([unknown.lowest - null, unknown.highest - null])
    signs = (np.array([1.0]), np.array([-1.0]))
    shares = [np.diff(stdtr(size.freedom, (ends - s * size.usual) / size.width))[0] for s in signs]
    return float(np.log(max(sum(shares), 1e-12)))


def size_of(unknown: Unknown, share: Callable[[], float]) -> Size:
    """The prior of an amplitude by the usual size in its entry.

    `share` gives the relative change of its place per amplitude.
    """
    usual = unknown.usual
    if usual is None:
        width = unknown.highest - unknown.lowest
        return Size(width / 4.0 if np.isfinite(width) else 1.0, 1.0)
    spread = float(np.log(usual.factor))
    freedom = 2.0 / spread
    median = usual.size / share() if usual.of_place else usual.size
    return Size(median / float(stdtrit(freedom, 0.75)), freedom, median, median * spread)


def share_of(system: System, candidate: Candidate, unknown: Unknown) -> float:
    """Largest relative change of estimates per amplitude, over all shapes.

    For a reading whose zero is arbitrary it is relative to the range of the sensor.
    """
    null = {u.id: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}
    fixed, shares = references(system, candidate), []
    plain = system.flows(Configuration()).values
    reading = _without_zero(system, candidate)
    for shape in starts(system, candidate):
        setting = Configuration().joining(candidate, {**null, **shape}, fixed)
        modules = system.reached(candidate.observers)
        flows = system.flows(setting, [unknown.id], modules=modules)
        for i, slope in flows.by_value[unknown.id].items():
            whole = plain[i]
            if reading is not None:
                whole = flows.by_reading[reading][i] * span(system, reading)
            with np.errstate(invalid="ignore", divide="ignore"):
                share = np.broadcast_to(slope / whole, plain[i].shape)
            share = share[system.data.open & system.valid[i] & np.isfinite(share)]
            shares.append(float(np.sqrt(np.mean(share**2))) if len(share) else 0.0)
    return max(shares, default=0.0) or 1.0


def _without_zero(system: System, candidate: Candidate) -> str | None:
    """The reading that a candidate corrects, if its zero is arbitrary.

    A share of a temperature means nothing: 5 % of 20 degC would be 15 kelvin.
    """
    signal, plant = f"{candidate.module}.{candidate.place}", system.builder.network.plant
    if signal not in system.shared:
        return None
    own = plant.modules[candidate.module].type.signals[candidate.place]
    return signal if has_no_zero(own, plant.knowledge.units) else None


def span(system: System, signal: str) -> float:
    """Range of a sensor, SI, or of its readings where none is stated."""
    low, high = system.ruleset.signal_by_id[signal].ends
    if np.isfinite(high - low):
        return high - low
    values = system.data.values[signal]
    return float(np.nanmax(values) - np.nanmin(values))


def prior_with_sizes(
    plain: Prior,
    setting: Configuration,
    size_of: Callable[[Candidate, Unknown], Size],
    range_of: Callable[[Unknown, float], tuple[float, float]],
) -> Prior:
    """Add the amplitudes and shapes of effects to the prior of the plant.

    `size_of` gives the prior of an amplitude, `range_of` the middle and width of the range of a
    shape, by its starting value.
    """
    own = {u.id: (c, u) for c in setting.joined for u in c.unknowns}
    mean, known, freedom = plain.mean.copy(), plain.known.copy(), plain.freedom.copy()
    odds = 0.0
    for i, name in enumerate(plain.names):
        stem = name.partition("#")[0]
        if stem not in own:
            continue
        candidate, unknown = own[stem]
        if unknown.null is not None:
            size = size_of(candidate, unknown)
            off = setting.values[name] - unknown.null
            freedom[i] = size.freedom
            if np.isfinite(size.width):
                mean[i] = unknown.null + np.copysign(size.usual, off)
                known[i] = size.width**-2
                odds -= log_inside(size, unknown)
            else:
                mean[i], known[i] = unknown.null, size.scale**-2
        else:
            mean[i], width = range_of(unknown, setting.values[name])
            known[i] = 12.0 / width**2
    return replace(plain, mean=mean, known=known, freedom=freedom, odds=odds)


def known_of(prior: Prior, setting: Configuration) -> dict[str, tuple[float, float, float]]:
    """Mean, scale and degrees of freedom of those unknowns that have a prior."""
    unknowns = set(setting.free_unknowns())
    each = zip(prior.names, prior.mean, prior.known, prior.freedom, strict=True)
    return {n: (float(m), float(k**-0.5), float(f)) for n, m, k, f in each if n in unknowns and k}


def range_over(unknown: Unknown, start: float, driver: Array | None) -> tuple[float, float]:
    """Middle and width of the range of a shape, by the readings of its driver."""
    if driver is not None:
        low, high = np.nanquantile(driver, [0.02, 0.98])
        return float(low + high) / 2, max(float(high - low), 1e-12)
    if unknown.offset:
        # The zero of its unit is arbitrary: only the stated range is known.
        return (unknown.lowest + unknown.highest) / 2, unknown.highest - unknown.lowest
    width = 2.0 * max((abs(s) for s in unknown.starts), default=abs(start)) or 1.0
    return float(np.sign(start) or 1.0) * width / 2, width


KNOTS = np.linspace(0.0, 1.0, 41)
"""Shares of a driver's range at which functions are tabulated; they are linear in between."""


@dataclass(frozen=True)
class Basis:
    """Functions of a driver from `low` to `high`, constant beyond these ends.

    `length` is their correlation length as a share of that range; `says` is empty, as nothing
    switches them, and `price` zero, as nothing more has to be specified.
    """

    low: float
    high: float
    length: float
    says: str = ""
    price: float = 0.0

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

    `says` is what switches it, `price` the cost of specifying its ends, nats.
    """

    ends: Array
    level: Array
    says: str
    price: float
    length: float = 0.0

    def at(self, time: Array) -> Array:
        """The function at times, shape (n, 1)."""
        return np.asarray(self.level[np.searchsorted(self.ends, time, side="right")][:, None])


@dataclass(frozen=True)
class Term:
    """A change at a place that follows a driver by a law without a name.

    `spot` is the id of the place; `changed` is that place or a parameter of its law. `slopes`,
    shape (open rows,), are those of the residuals by `changed`, SI. `columns`, shape (open rows,
    functions), are the effects of the functions of `basis` on the residuals, over their `norm`;
    their size is estimated along with the errors of form.
    """

    name: str
    spot: str
    changed: DisturbanceLocation
    driver: str
    slopes: Array
    basis: Basis | Switching
    norm: float
    columns: Array


def term_with(
    columns: Array,
    place: str,
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
    return Term(name, place, changed, driver, slopes, basis, norm, columns / norm)


@dataclass(frozen=True)
class Sizes:
    """Sizes of random columns.

    `moving` is the size of sensor errors that move, as a share of their class; `terms` are those of
    terms without a name, in units of the noise of a point. `laws` has the error of each law by the
    id of its place, in units of what its accuracy allows; it is known within a factor of two.
    """

    moving: float
    terms: tuple[float, ...]
    laws: Mapping[str, float] = field(default_factory=dict)

    @property
    def odds(self) -> float:
        """Log prior density of all but terms."""
        far = [np.log(self.moving / limits.USUAL_MOVING) / np.log(limits.MOVING_KNOWN)]
        far += [np.log(times) / np.log(limits.FORM_KNOWN) for times in self.laws.values()]
        return -0.5 * float(np.sum(np.square(far)))

    def of(self, laws: Sequence[str]) -> Array:
        """Size of the error of form of each law, in units of what its accuracy allows."""
        return np.array([self.laws.get(name, 1.0) for name in laws])


USUAL = Sizes(limits.USUAL_MOVING, ())
"""Prior sizes."""


@dataclass(frozen=True)
class Random:
    """Random columns: errors of form, with the `law` of each, sensor errors that move within their
    class, errors of held inputs, and terms without a name. All sizes but those of held inputs are
    estimated."""

    forms: Array
    law: tuple[str, ...]
    moving: Array
    held: Array
    terms: tuple[Term, ...]

    @property
    def count(self) -> int:
        """Number of columns."""
        return int(self.columns.shape[1])

    def ratio(self, sizes: Sizes) -> Array:
        """Standard deviation of each column's amount, shape (columns,)."""
        parts = [sizes.of(self.law)]
        parts += [np.full(self.moving.shape[1], sizes.moving), np.ones(self.held.shape[1])]
        own = zip(self.terms, sizes.terms, strict=True)
        parts += [np.full(t.columns.shape[1], size) for t, size in own]
        return np.concatenate(parts)

    @property
    def columns(self) -> Array:
        """All columns, each of unit size, shape (rows, columns)."""
        own = [t.columns for t in self.terms]
        return np.concatenate([self.forms, self.moving, self.held, *own], axis=1)


Noise = tuple[float, ...]
"""Parameters of the noise."""


class Point(Protocol):
    """A model at some values: its residual, shape (rows,), and the slopes of that by the
    coordinates of the values, shape (rows, values)."""

    @property
    def setting(self) -> Configuration: ...

    @property
    def residual(self) -> Array: ...

    @property
    def jacobian(self) -> Array: ...


class Evidence(ABC):
    """What all models of one recording have in common.

    `forms` are rows of errors of form, shape (rows, errors), each of the law in `law`; `moving` and
    `held` are rows of sensor errors that move within their class, and of all others. `of_class` are
    rows of sensor errors that are not among the values; `readings` are ids of all sensors. A refit
    ends where a step gains less than `ended`, nats; the search for the noise starts at
    `usual_noise`.
    """

    forms: Array
    law: tuple[str, ...]
    moving: Array
    held: Array
    usual_noise: Noise
    ended: float = 1e-2
    of_class: tuple[Array, ...] = ()
    readings: frozenset[str] = frozenset()

    @property
    @abstractmethod
    def noises(self) -> tuple[tuple[float, ...], ...]:
        """Values to try for each parameter of the noise."""

    @property
    @abstractmethod
    def candidates(self) -> Sequence[Candidate]:
        """Effects that the model may lack."""

    def of_reading(self, changed: Candidate | DisturbanceLocation) -> bool:
        """Is it the reading of a sensor, rather than a law or a parameter, that changes?"""
        return f"{changed.module}.{changed.place}" in self.readings

    @property
    @abstractmethod
    def terms(self) -> int:
        """Number of possible terms without a name."""

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of rows."""

    @abstractmethod
    def prior(self, setting: Configuration) -> Prior:
        """The prior of all values."""

    @abstractmethod
    def size(self, candidate: Candidate, unknown: Unknown) -> Size:
        """The prior of an amplitude."""

    @abstractmethod
    def evaluated(self, setting: Configuration, prior: Prior, at: Array) -> Point:
        """The model at some coordinates, shape (values,)."""

    @abstractmethod
    def effect_forms(self, now: Point) -> Array:
        """Rows of the errors of form of the effects' own laws, shape (rows, errors)."""

    def whitened(self, columns: Array, noise: Noise) -> Array:
        """Columns, shape (rows,) or (rows, columns), as rows with independent noise."""
        return self.whitener(columns)(noise)

    @abstractmethod
    def whitener(self, columns: Array) -> Callable[[Noise], Array]:
        """`whitened` for fixed columns, as a function of the noise."""

    @abstractmethod
    def likelihood(self, residual: Array, noise: Noise) -> float:
        """Log likelihood of a whitened residual, shape (rows,)."""

    def weights(self, residual: Array, noise: Noise) -> Array:
        """Weights of whitened rows in the normal matrix, shape (rows,)."""
        return self.scored(residual[:, None], noise)[0][:, 0]

    @abstractmethod
    def expected_weights(self, noise: Noise) -> Array:
        """Mean information of each whitened row, shape (rows,)."""

    @abstractmethod
    def drawn(self, noise: Noise, count: int, rng: np.random.Generator) -> Array:
        """Random noise of whitened rows, shape (rows, count)."""

    @abstractmethod
    def scored(self, residuals: Array, noise: Noise) -> tuple[Array, Array]:
        """Weights of whitened rows in the normal matrix, shape (rows, n), and twice their loss of
        log likelihood, shape (n,); `residuals` has shape (rows, n)."""

    @abstractmethod
    def noise_odds(self, noise: Noise) -> float:
        """Log prior density of the noise."""

    def likely_noises(self, residual: Array) -> list[Noise]:
        """Noise from which to start, besides the given one, by a residual, shape (rows,)."""
        return []

    @abstractmethod
    def levels(self, noise: Noise, rest: Callable[[], Array], *, alone: bool) -> list[Noise]:
        """Noise under which further explanations show best, with all rows weighted alike.

        `noise` is that of the model, `rest` gives its residual, shape (rows,); the model is `alone`
        where nothing is joined.
        """

    @abstractmethod
    def alike(self, noise: Noise) -> Array:
        """Weights of whitened rows if none is an outlier, shape (rows,)."""

    @abstractmethod
    def shown(self, columns: Array) -> dict[str, float]:
        """By how much errors, shape (rows, errors), move each output: root of their summed mean
        squares, SI."""
