"""The interface between the search and a recording of any plant: rows, and allowed model errors.

A model is linearised at its values: its residual, shape (rows,), is r = r0 + J_theta d_theta +
J_w w + J_b b + J_c c + noise. Values of the plant and of joined candidates have lasting priors.
Errors of sensors within their class (b) and errors of form of each law within its accuracy (c) are
random columns, which are integrated out. The slopes are those of operating points at settled
points, and those of a simulation in plants that store; the search need not know which.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Protocol

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, DisturbanceLocation, Unknown
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import Configuration, Course
from rulec.mismatch.evidence.prior import Prior, Size, log_inside, range_over, size_of
from rulec.mismatch.evidence.term import Term

# Candidates as columns: slopes of the residuals by one amplitude, all else of it held.

Names = frozenset[str]
"""Names of candidates, with marks for those that begin, come and go or grow, and of terms."""

COMES, GROWS = "!", "/"
"""Marks after the id of a candidate that begins or comes and goes, and of one that grows."""


def marked(id_: str, course: Course | None) -> str:
    """The id of a candidate, marked where it begins, comes and goes, or grows."""
    if course is None:
        return id_
    return id_ + (GROWS if course.grows else COMES)


def name_of(setting: Configuration, candidate: Candidate) -> str:
    """The marked id of a joined candidate."""
    own = {u.id for u in candidate.unknowns}
    return marked(candidate.id, next((c for c in setting.courses if c.unknown in own), None))


def id_of(name: str) -> str:
    """The id of a candidate by its name, without marks."""
    return name.rstrip(COMES + GROWS)


@dataclass(frozen=True, kw_only=True)
class Column:
    """One amplitude of a candidate with its other unknowns held; `rows` are its slopes.

    `course` is that of a fault that begins, grows, or comes and goes.
    """

    candidate: Candidate
    amplitude: Unknown
    values: dict[str, float]
    fixed: dict[str, float]
    rows: Array
    course: Course | None = None

    @property
    def name(self) -> str:
        """The marked id of the candidate."""
        return marked(self.candidate.id, self.course)


@dataclass(frozen=True)
class Proposal:
    """Columns that may be joined together, each with the amplitude from which to start a refit, and
    their gain in log odds."""

    gain: float
    starts: tuple[tuple[Column, float], ...]

    @property
    def names(self) -> Names:
        """Names of the columns."""
        return frozenset(column.name for column, _ in self.starts)

    @property
    def shapes(self) -> frozenset[tuple[str, frozenset[tuple[str, float]]]]:
        """Names of the columns, each with the values at which it was made."""
        return frozenset((c.name, frozenset(c.values.items())) for c, _ in self.starts)

    def joined_to(self, setting: Configuration) -> Configuration:
        """Join the columns to a setting."""
        for column, value in self.starts:
            candidate, name = column.candidate, column.amplitude.id
            if candidate.id in {c.id for c in setting.joined}:
                setting = replace(setting, values={**setting.values, name: value})
            else:
                own = {**column.values, name if column.course is None else f"{name}#0": value}
                setting = setting.joining(candidate, own, column.fixed, column.course)
        return setting


def amplitudes_of(candidate: Candidate) -> dict[Unknown, float]:
    """Amplitudes of a candidate with their nulls."""
    return {u: u.null for u in candidate.unknowns if u.null is not None and not u.fixed}


# Random columns, and their sizes.


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
        far = [np.log(self.moving / common.USUAL_MOVING) / np.log(limits.MOVING_KNOWN)]
        far += [np.log(times) / np.log(common.FORM_KNOWN) for times in self.laws.values()]
        return -0.5 * float(np.sum(np.square(far)))

    def of(self, laws: Sequence[str]) -> Array:
        """Size of the error of form of each law, in units of what its accuracy allows."""
        return np.array([self.laws.get(name, 1.0) for name in laws])


USUAL = Sizes(common.USUAL_MOVING, ())
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

    @cached_property
    def columns(self) -> Array:
        """All columns, each of unit size, shape (rows, columns)."""
        own = [t.columns for t in self.terms]
        return np.concatenate([self.forms, self.moving, self.held, *own], axis=1)


def fewest(table: Array, times: float, least: float = 0.0) -> Array:
    """The fewest columns with the same sum of squares, without those that do not show at `times`
    their size, or have at most a share `least` of the largest one."""
    left, size, _ = np.linalg.svd(table, full_matrices=False)
    kept = (size * times > limits.FORM_NOT_SEEN) & (size > least * size.max(initial=0.0))
    return np.asarray(left[:, kept] * size[kept])


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


Index = tuple[int, ...]
"""Indices of the parameters of the noise, and of all sizes, on a grid."""


def climbed(
    score: Callable[[Index], float], begin: Index, lengths: Sequence[int], fresh: Collection[int]
) -> Index:
    """The best place of a grid that steps along one axis at a time reach from another one.

    All combinations of the axes in `fresh` are tried first.
    """
    ways = [range(n) if i in fresh else (begin[i],) for i, n in enumerate(lengths)]
    best = max(product(*ways), key=score)
    while True:
        beside = [
            (*best[:i], best[i] + step, *best[i + 1 :])
            for i, n in enumerate(lengths)
            for step in (-1, 1)
            if 0 <= best[i] + step < n
        ]
        next_ = max(beside, key=score)
        if not score(next_) > score(best):
            return best
        best = next_


class Evidence(ABC):
    """What all models of one recording have in common.

    It has `count` rows. `candidates` are effects that the model may lack, `term_count` counts the
    places and drivers of a term without a name; `readings` are ids of all sensors. `forms` are rows
    of errors of form, shape (rows, errors), each of the law in `law`; `moving` and `held` are rows
    of sensor errors that move within their class, and of all others, `of_class` of those that are
    not among the values. The search for the noise tries the values in `noises` of each of its
    parameters, from `usual_noise` on. A refit ends where a step gains less than `ended`, nats. Sets
    of named explanations have at most `most` members, with terms among them only if laws are tried
    `beside_terms`.
    """

    count: int
    candidates: Sequence[Candidate]
    term_count: int
    readings: frozenset[str]
    forms: Array
    law: tuple[str, ...]
    moving: Array
    held: Array
    noises: tuple[tuple[float, ...], ...]
    usual_noise: Noise
    ended: float = 1e-2
    most: int = common.LARGEST_SET
    beside_terms: bool = True
    of_class: tuple[Array, ...] = ()

    def __init__(self) -> None:
        self._sizes: dict[str, Size] = {}
        self._errors: dict[str, tuple[float, float]] | None = None

    def of_reading(self, changed: Candidate | DisturbanceLocation) -> bool:
        """Is it the reading of a sensor, rather than a law or a parameter, that changes?"""
        return f"{changed.module}.{changed.place}" in self.readings

    def prior(self, setting: Configuration) -> Prior:
        """The prior of all values: that of the plant, with usual sizes of the amplitudes of effects
        and ranges of their shapes."""
        plain, odds = self.plain_prior(setting), 0.0
        own = {u.id: (c, u) for c in setting.joined for u in c.unknowns}
        mean, precision, freedom = plain.mean.copy(), plain.precision.copy(), plain.freedom.copy()
        for i, name in enumerate(plain.names):
            stem = name.partition("#")[0]
            if stem not in own:
                continue
            candidate, unknown = own[stem]
            if unknown.null is None:
                driver = None if unknown.driver is None else self.driven_by(unknown.driver)
                mean[i], width = range_over(unknown, setting.values[name], driver)
                precision[i] = 12.0 / width**2
                continue
            size = self.size(candidate, unknown)
            freedom[i] = size.freedom
            if np.isfinite(size.width):
                off = setting.values[name] - unknown.null
                mean[i] = unknown.null + np.copysign(size.usual, off)
                precision[i] = size.width**-2
                odds -= log_inside(size, unknown)
            else:
                mean[i], precision[i] = unknown.null, size.scale**-2
        return replace(plain, mean=mean, precision=precision, freedom=freedom, odds=odds)

    @abstractmethod
    def plain_prior(self, setting: Configuration) -> Prior:
        """The prior of all values, without usual sizes of amplitudes and ranges of shapes."""

    @abstractmethod
    def driven_by(self, driver: str) -> Array:
        """Values of a driver of an effect in the plain model, shape (n,), SI."""

    def size(self, candidate: Candidate, unknown: Unknown) -> Size:
        """The prior of an amplitude."""
        if unknown.id not in self._sizes:
            self._sizes[unknown.id] = size_of(unknown, lambda: self.share(candidate, unknown))
        return self._sizes[unknown.id]

    @abstractmethod
    def share(self, candidate: Candidate, unknown: Unknown) -> float:
        """Largest relative change of estimates or readings per amplitude, over all shapes."""

    @abstractmethod
    def evaluated(self, setting: Configuration, prior: Prior, at: Array) -> Point:
        """The model at some coordinates, shape (values,)."""

    @abstractmethod
    def columns(self, point: Point, candidates: Iterable[Candidate]) -> list[Column]:
        """Columns for each amplitude of candidates that are not joined, at several shapes."""

    def terms(self, point: Point) -> list[Term]:
        """Terms without a name for each place and each driver, linearised at a model.

        Those at a reading are usually as large as the errors that the catalogue has for it.
        """
        if self._errors is None:
            self._errors = self._usual_errors(point)
        found = []
        for term in self.terms_of_any_size(point):
            place = f"{term.changed.module}.{term.changed.place}"
            usual, factor = self._errors.get(place, (np.inf, 1.0))
            found.append(replace(term, usual=usual, factor=factor))
        return found

    def _usual_errors(self, point: Point) -> dict[str, tuple[float, float]]:
        """Usual size of the largest error that the catalogue has for each reading, in units of the
        noise of a point, as the median over its shapes, and its geometric standard deviation."""
        shown = dict[tuple[str, str, float], list[float]]()
        for column in self.columns(point, filter(self.of_reading, self.candidates)):
            one, amplitude = column.candidate, column.amplitude
            if amplitude.usual is not None and column.course is None:
                place = f"{one.module}.{one.place}"
                size = self.size(one, amplitude).usual * float(np.sqrt(np.mean(column.rows**2)))
                shown.setdefault((place, amplitude.id, amplitude.usual.factor), []).append(size)
        found = dict[str, tuple[float, float]]()
        for (place, _, factor), sizes in shown.items():
            found[place] = max(found.get(place, (0.0, factor)), (float(np.median(sizes)), factor))
        return found

    @abstractmethod
    def terms_of_any_size(self, point: Point) -> list[Term]:
        """`terms` without the usual sizes of errors of readings."""

    @abstractmethod
    def starting_points(
        self, setting: Configuration, every: Sequence[Column], proposals: Sequence[Proposal]
    ) -> Iterator[tuple[Names, Configuration]]:
        """Where the refits of a setting with proposals joined begin, each with the names of what is
        joined; `every` are all columns beside that setting."""

    @abstractmethod
    def effect_forms(self, now: Point) -> Array:
        """Rows of the errors of form of the effects' own laws, shape (rows, errors)."""

    def whitened(self, columns: Array, noise: Noise) -> Array:
        """Columns, shape (rows,) or (rows, columns), as rows with independent noise."""
        return self.whitener(columns)(noise)

    def whitener(self, columns: Array) -> Callable[[Noise], Array]:
        """`whitened` for fixed columns, as a function of the noise; independent noise leaves them
        as they are."""
        return lambda noise: columns

    @abstractmethod
    def likelihood(self, residual: Array, noise: Noise) -> float:
        """Log likelihood of a whitened residual, shape (rows,)."""

    def weights(self, residual: Array, noise: Noise) -> Array:
        """Weights of whitened rows in the normal matrix, shape (rows,)."""
        return self.alike(noise)

    def expected_weights(self, noise: Noise) -> Array:
        """Mean information of each whitened row, shape (rows,)."""
        return self.alike(noise)

    @abstractmethod
    def noise_odds(self, noise: Noise) -> float:
        """Log prior density of the noise."""

    def likely_noises(self, residual: Array) -> list[Noise]:
        """Noise from which to start, besides the given one, by a residual, shape (rows,)."""
        return []

    def levels(self, noise: Noise, rest: Callable[[], Array], *, alone: bool) -> list[Noise]:
        """Noise under which further explanations show best, with all rows weighted alike: large and
        rare errors show.

        `noise` is that of the model, `rest` gives its residual, shape (rows,); the model is `alone`
        where nothing is joined.
        """
        return [noise]

    def alike(self, noise: Noise) -> Array:
        """Weights of whitened rows if none is an outlier, shape (rows,)."""
        return np.ones(self.count)

    @abstractmethod
    def shown(self, columns: Array) -> dict[str, float]:
        """By how much errors, shape (rows, errors), move each output: root of their summed mean
        squares, SI."""
