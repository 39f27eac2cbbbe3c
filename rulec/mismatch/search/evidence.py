"""A recording as the search sees it, whatever the plant: rows, and what any model may be wrong by.

A model is made linear where it lies: its residual, shape (rows,), is r = r0 + J_theta d_theta +
J_w w + J_b b + J_c c + noise. Values of the plant and of what is joined have lasting priors; errors
of sensors within their class (b) and of the form of each law within its accuracy (c) are random
columns, which are integrated out. At settled points the slopes are those of operating points, in
plants that store those of a simulation; nothing above this line knows which.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, Spot, Unknown
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Prior
from rulec.mismatch.search import limits
from rulec.mismatch.search.sizes import Size


class Functions(Protocol):
    """Functions of a driver; `length` tells smooth ones of one name apart, `says` what switches the
    others. `price` is what it takes to tell them, nats."""

    @property
    def length(self) -> float: ...

    @property
    def says(self) -> str: ...

    @property
    def price(self) -> float: ...

    def at(self, values: Array) -> Array:
        """The functions at values of the driver, shape (n, functions)."""
        ...


@dataclass(frozen=True)
class Term:
    """A change at a place that follows a driver in a way without a name.

    `spot` is the id of the place, `changed` that place, or the parameter of its law that changes.
    `slopes`, shape (seen rows,), are those of the residuals by `changed`, SI. `columns`, shape
    (seen rows, functions), are the functions of `basis`, each as it shows, over their `norm`; how
    large they are is found with the errors of form.
    """

    name: str
    spot: str
    changed: Spot
    driver: str
    slopes: Array
    basis: Functions
    norm: float
    columns: Array


@dataclass(frozen=True)
class Sizes:
    """How large random columns are: errors of sensors that move as share of their class, terms
    without a name in units of the noise of a point.

    `laws` says how many times the error that its accuracy allows each law has, by the id of its
    place: it is known within a factor of two."""

    moving: float
    terms: tuple[float, ...]
    laws: Mapping[str, float] = field(default_factory=dict)

    @property
    def odds(self) -> float:
        """Log density of all but terms, before the recording."""
        far = [np.log(self.moving / limits.USUAL_MOVING) / np.log(limits.MOVING_KNOWN)]
        far += [np.log(times) / np.log(limits.FORM_KNOWN) for times in self.laws.values()]
        return -0.5 * float(np.sum(np.square(far)))

    def of(self, laws: Sequence[str]) -> Array:
        """Size of the error of form of each law, in those that its accuracy allows."""
        return np.array([self.laws.get(name, 1.0) for name in laws])


USUAL = Sizes(limits.USUAL_MOVING, ())
"""Sizes before the recording."""


@dataclass(frozen=True)
class Random:
    """Random columns; `law` is the law of each of the errors of form. Sizes of errors of form, of
    errors of sensors that move within their class, and of terms without a name are found; those of
    held inputs are known."""

    forms: Array
    law: tuple[str, ...]
    moving: Array
    held: Array
    terms: tuple[Term, ...]

    @property
    def count(self) -> int:
        """Number of columns."""
        count: int = self.columns.shape[1]
        return count

    def ratio(self, sizes: Sizes) -> Array:
        """Standard deviation of each column's number, shape (columns,)."""
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
"""What noise is like: the numbers that tell it."""


class Point(Protocol):
    """A model at some values: its residual, shape (rows,), and slopes of that by the coordinates of
    the values, shape (rows, values)."""

    @property
    def setting(self) -> Configuration: ...

    @property
    def residual(self) -> Array: ...

    @property
    def jacobian(self) -> Array: ...


class Evidence(ABC):
    """What stays the same for all models of one recording.

    `forms` are rows of errors of form, shape (rows, errors), each of the law that `law` names;
    `moving` and `held` those of errors of sensors that move within their class, and of all others.
    `of_class` are rows of errors of sensors that are no values; `readings` are ids of all sensors.
    A refit has ended where a step gains less than `ended`, nats; `usual_noise` is where a search
    for what noise is like begins.
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
        """For each number that tells what noise is like, values that are tried."""

    @property
    @abstractmethod
    def candidates(self) -> Sequence[Candidate]:
        """What may be missing."""

    def of_reading(self, changed: Candidate | Spot) -> bool:
        """Is it what a sensor reads that changes, and neither a law nor a parameter?"""
        return f"{changed.module}.{changed.place}" in self.readings

    @property
    @abstractmethod
    def terms(self) -> int:
        """How many terms without a name there may be."""

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of rows."""

    @abstractmethod
    def prior(self, setting: Configuration) -> Prior:
        """What is known of all values."""

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
        """Rows whose noise is independent, of columns, shape (rows,) or (rows, columns)."""
        return self.whitener(columns)(noise)

    @abstractmethod
    def whitener(self, columns: Array) -> Callable[[Noise], Array]:
        """What `whitened` gives of columns, by noise."""

    @abstractmethod
    def likelihood(self, residual: Array, noise: Noise) -> float:
        """Log likelihood of a whitened residual, shape (rows,)."""

    @abstractmethod
    def weights(self, residual: Array, noise: Noise) -> Array:
        """Weights of whitened rows in the normal matrix, shape (rows,)."""

    @abstractmethod
    def expected_weights(self, noise: Noise) -> Array:
        """What each whitened row tells on average, shape (rows,)."""

    @abstractmethod
    def drawn(self, noise: Noise, count: int, rng: np.random.Generator) -> Array:
        """Noise of whitened rows as often as asked, shape (rows, count)."""

    @abstractmethod
    def scored(self, residuals: Array, noise: Noise) -> tuple[Array, Array]:
        """Weights of whitened rows in the normal matrix, shape (rows, n), and twice what they lose
        of the log likelihood, shape (n,); `residuals` has shape (rows, n)."""

    @abstractmethod
    def noise_odds(self, noise: Noise) -> float:
        """Log density of what noise is like, before the recording."""

    @abstractmethod
    def likely_noises(self, residual: Array) -> list[Noise]:
        """What noise may be like by what is left, shape (rows,), to begin with."""

    @abstractmethod
    def levels(self, noise: Noise, rest: Callable[[], Array], *, alone: bool) -> list[Noise]:
        """Noise under which other explanations of a model stand out, with all rows alike.

        `noise` is that of the model and `rest` gives what it leaves, shape (rows,); it is `alone`
        where nothing is joined.
        """

    @abstractmethod
    def alike(self, noise: Noise) -> Array:
        """Weights of whitened rows if none is odd, shape (rows,)."""

    @abstractmethod
    def shown(self, columns: Array) -> dict[str, float]:
        """By how much some errors, one a column, shape (rows, errors), move each output: root of
        their summed mean squares, SI."""
