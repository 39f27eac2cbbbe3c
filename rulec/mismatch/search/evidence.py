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
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, DisturbanceLocation, Unknown
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Prior
from rulec.mismatch.search import limits
from rulec.mismatch.search.sizes import Size


class Functions(Protocol):
    """Functions of a driver.

    `length` distinguishes smooth ones of one name, `says` is what switches the others. `price` is
    the cost of specifying them, nats.
    """

    @property
    def length(self) -> float: ...

    @property
    def says(self) -> str: ...

    @property
    def price(self) -> float: ...

    def at(self, values: Array) -> Array:
        """The functions at values of the driver, shape (n, functions)."""


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
    basis: Functions
    norm: float
    columns: Array


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
