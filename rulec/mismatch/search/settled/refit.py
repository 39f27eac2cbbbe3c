"""A set of explanations refitted, and its evidence by Laplace's approximation.

Errors of the outputs follow a Student distribution per point. Each law may besides be off by an
error of form that is smooth over its arguments, and as large as its accuracy says within a factor
of two: a law that is off by more has something missing, however smoothly.

Source: MacKay 1992 (evidence); Kennedy and O'Hagan 2001 (error of form as a Gaussian process).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dpotri
from scipy.special import ndtr

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.steady.configuration import ERROR, Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, Prior, evaluated
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.search import limits
from rulec.mismatch.search.settled.effect_forms import forms_of_effects
from rulec.mismatch.search.settled.geometry import USUAL, Geometry, Random, Sizes, Term
from rulec.mismatch.search.settled.prior import prior_with_sizes


@dataclass(frozen=True, kw_only=True)
class Model:
    """A refitted set of explanations.

    `at` are the coordinates of the values, `mean` what was known of them before as it counts there.
    `table` shape (rows, values) are slopes by the values, errors of form and errors of the
    effects' forms; `left`, shape (rows,), the residual at the means of the values; `precision` that
    of the prior, `weights` those of the rows. `evidence` is the log marginal likelihood.
    """

    fitted: Fitted
    prior: Prior
    mean: Array
    at: Array
    forms: Array
    terms: tuple[Term, ...]
    sizes: Sizes
    scale: float
    evidence: float
    table: Array
    left: Array
    precision: Array
    weights: Array

    @property
    def setting(self) -> Configuration:
        """What is joined, and all values."""
        return self.fitted.setting

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the values, SI, shape (values, values)."""
        normal = self.table.T @ (self.table * self.weights[:, None]) + self.precision
        size, n = np.sqrt(np.diag(normal)), len(self.at)
        inverse = np.linalg.pinv(normal / np.outer(size, size), hermitian=True)[:n, :n]
        step = self.prior.coordinates.slopes(self.at) / size[:n]
        covariance: Array = inverse * np.outer(step, step)
        return covariance

    def shows(self, geometry: Geometry) -> float:
        """Probability that what is joined moves some output by more than `allowed`."""
        null = {u.id: u.null for c in self.setting.joined for u in c.unknowns if not u.fixed}
        allowed, hidden = self.allowed(geometry), 1.0
        u = np.sqrt(np.diag(self.covariance)) / self.prior.coordinates.slopes(self.at)
        for i, name in enumerate(self.prior.names):
            start = null.get(name.partition("#")[0])
            if start is None:
                continue
            moved = geometry.shown(self.table[:, [i]])
            ends = [allowed[name] / most for name, most in moved.items() if most > 0.0]
            end, off = min(ends, default=np.inf), self.at[i] - start
            hidden = min(hidden, float(np.diff(ndtr((np.array([-end, end]) - off) / u[i]))[0]))
        return 1.0 if self.terms else 1.0 - hidden

    def allowed(self, geometry: Geometry) -> dict[str, float]:
        """Error of each output that sensors within their class, and laws within their accuracy,
        explain in 19 of 20 recordings, SI."""
        errors = [i for i, name in enumerate(self.prior.names) if name.startswith(ERROR)]
        of_sensors = self.table[:, errors]
        columns = np.concatenate([geometry.forms, of_sensors], axis=1)
        return {n: common.NORMAL_95 * u for n, u in geometry.shown(columns).items()}


@dataclass(frozen=True)
class _Chosen:
    """Sizes of random columns, noise, and the linear solution with them."""

    score: float
    sizes: Sizes
    scale: float
    solution: Array
    weights: Array
    ratio: Array
    spread: tuple[Array, Array]
    table: Array = field(default_factory=lambda: np.zeros((0, 0)))


def refitted(
    geometry: Geometry,
    setting: Configuration,
    near: Model | None = None,
    terms: tuple[Term, ...] = (),
    steps: int = 25,
    without_error: Collection[str] = (),
) -> Model:
    """Refit all values, errors of form among them; `near` is a model that is much alike.

    Sensors `without_error` read as they are: whoever uses the plant reads the same ones.

    Raises `numpy.linalg.LinAlgError` where the model has no slopes in which to begin.
    """
    rows, seen = geometry.rows, geometry.seen
    prior = prior_with_sizes(geometry, setting)
    held = np.isin(prior.names, [ERROR + name for name in without_error])
    low, high = (np.where(held, 0.0, end) for end in (prior.lowest, prior.highest))
    prior = replace(prior, lowest=low, highest=high)
    n = len(prior.names)
    at = np.clip(prior.of(setting.values), prior.lowest, prior.highest)
    random = Random(geometry.forms, geometry.law, geometry.moving, geometry.held, terms)
    forms = np.zeros(random.count)
    if near is not None:
        kept = min(len(forms), len(near.forms))
        forms[:kept] = near.forms[:kept]
    sizes = USUAL if near is None else near.sizes
    own = {} if near is None else dict(zip(_names(near.terms), near.sizes.terms, strict=True))
    sizes = replace(sizes, terms=tuple(own.get(name, 1.0) for name in _names(terms)))
    scale = 1.0 if near is None else near.scale
    fresh = [2 + i for i, name in enumerate(_names(terms)) if name not in own]
    fresh += [0] if near is None else []
    no_more = np.zeros((int(seen.sum()), 0))
    pressed = np.zeros(n, dtype=bool)
    now = _evaluated(rows, setting, prior, at)
    if not (np.isfinite(now.residual[seen]).all() and np.isfinite(now.jacobian[seen]).all()):
        raise np.linalg.LinAlgError("the model has no finite slopes where the refit begins")
    damping, cost = 1e-3, np.inf
    for step in range(steps):
        if step in (0, 4):
            begin = at, forms, sizes, scale
            found = _choose(geometry, prior, random, now, begin, no_more, fresh, held)
            sizes, scale, forms, fresh = found.sizes, found.scale, found.solution[n:], []
            loads = random.columns * random.ratio(sizes)
            cost = _cost(geometry, prior, now, at, forms, loads, scale)
        residual = now.residual[seen] + loads @ forms
        table = np.concatenate([now.jacobian[seen], loads], axis=1)
        weights = geometry.weights(residual, scale)
        known, precision = prior.near(at), np.eye(table.shape[1])
        precision[:n, :n] = known.precision
        normal = table.T @ (table * weights[:, None]) + precision
        slope = table.T @ (weights * residual)
        slope += precision @ np.concatenate([at - known.mean, forms])
        stopped = np.zeros(len(slope), dtype=bool)
        stopped[:n] = (at <= prior.lowest) & (slope[:n] > 0)
        stopped[:n] |= (at >= prior.highest) & (slope[:n] < 0)
        stopped[:n] |= held
        free, pressed = np.flatnonzero(~stopped), stopped[:n]
        size = np.sqrt(np.diag(normal))[free]
        scaled = normal[np.ix_(free, free)] / np.outer(size, size)
        gain = -1.0
        for _ in range(10):
            change = np.zeros(len(slope))
            damped = scaled + damping * np.eye(len(free))
            change[free] = -np.linalg.solve(damped, slope[free] / size) / size
            there = np.clip(at + change[:n], prior.lowest, prior.highest)
            moved = forms + change[n:]
            trial = _evaluated(rows, setting, prior, there)
            after = _cost(geometry, prior, trial, there, moved, loads, scale)
            gain = cost - after if np.isfinite(after) else -1.0
            if gain >= -1e-9:
                at, forms, now, cost = there, moved, trial, after
                damping = max(damping / 8.0, 1e-9)
                break
            damping = max(damping, 1e-6) * 8.0
        if gain < 1e-2:
            break
    return _weighed(geometry, prior, random, now, (at, forms, sizes, scale), pressed)


def _names(terms: Sequence[Term]) -> list[str]:
    return [term.name for term in terms]


def _evaluated(rows: Rows, setting: Configuration, prior: Prior, at: Array) -> Fitted:
    return evaluated(rows, setting, prior, at, rows.system.data.open)


def _cost(
    geometry: Geometry,
    prior: Prior,
    now: Fitted,
    at: Array,
    forms: Array,
    loads: Array,
    scale: float,
) -> float:
    residual = now.residual[geometry.seen] + loads @ forms
    likelihood = geometry.likelihood(residual, scale)
    return -likelihood - prior.near(at).density + 0.5 * float(forms @ forms)


Begin = tuple[Array, Array, Sizes, float]
"""Values, random numbers, their sizes, and the scale of the noise to begin with."""

Weighted = tuple[Array, Array, Array]
"""Normal matrix, moment, and the weights of the rows that they hold."""

Place = tuple[int, ...]
"""Indices of the scale of the noise and of all sizes."""


def _choose(
    geometry: Geometry,
    prior: Prior,
    random: Random,
    now: Fitted,
    begin: Begin,
    more: Array,
    fresh: Collection[int],
    pressed: NDArray[np.bool_] | None = None,
) -> _Chosen:
    """Sizes of random columns and noise under which the recording is most probable.

    `more` are columns of errors of the effects' own forms; `fresh` axes whose sizes are not known
    from a model that is much alike: these are tried throughout, the others climbed. Values that are
    `pressed` to an end of their range stay there.
    """
    at, forms, sizes, noise = begin
    n = len(at)
    jacobian = now.jacobian[geometry.seen]
    known = prior.near(at)
    off = at - known.mean
    if pressed is not None:
        jacobian, off = jacobian * ~pressed, off * ~pressed
    left = now.residual[geometry.seen] - jacobian @ off
    table = np.concatenate([jacobian, random.columns, more], axis=1)
    precision = _joint(known.precision, random.count, more.shape[1])
    start = np.concatenate([off, random.ratio(sizes) * forms, np.zeros(more.shape[1])])
    axes: list[tuple[float, ...]] = [limits.NOISE_SCALES, limits.MOVING_SHARES]
    axes += [limits.TERM_SIZES] * len(sizes.terms)

    def solved(sizes: Sizes, scale: float, weighted: Weighted) -> _Chosen:
        normal, moment, weights = weighted
        ratio = np.ones(len(precision))
        ratio[n : n + random.count] = random.ratio(sizes)
        ratio[n + random.count :] = limits.EFFECT_FORM
        whole = ratio[:, None] * normal * ratio + precision
        size = np.sqrt(np.diag(whole))
        whole /= size[:, None] * size
        whole[np.diag_indices(len(size))] += 1e-13
        factor = cho_factor(whole, lower=True, overwrite_a=True, check_finite=False)
        solution = -cho_solve(factor, moment * ratio / size, check_finite=False) / size
        residual = left + table @ (ratio * solution)
        score = geometry.likelihood(residual, scale) - 0.5 * float(solution @ precision @ solution)
        score -= float(np.sum(np.log(np.diag(factor[0]))) + np.sum(np.log(size)))
        score += sizes.odds - 0.5 * (np.log(scale) / np.log(limits.NOISE_KNOWN)) ** 2
        return _Chosen(score, sizes, scale, solution, weights, ratio, spread=(factor[0], size))

    def weighted_by(weights: Array) -> Weighted:
        return table.T @ (table * weights[:, None]), table.T @ (weights * left), weights

    @cache
    def weighted_at(scale: float) -> Weighted:
        return weighted_by(geometry.weights(left + table @ start, scale))

    @cache
    def at_place(place: Place) -> _Chosen:
        scale, moving, *own = (axis[i] for axis, i in zip(axes, place, strict=True))
        return solved(Sizes(moving, tuple(own), sizes.laws), scale, weighted_at(scale))

    first = (noise, sizes.moving, *sizes.terms)
    begins = tuple(_nearest(axis, value) for axis, value in zip(axes, first, strict=True))
    place = climbed(lambda p: at_place(p).score, begins, [len(axis) for axis in axes], fresh)
    best = at_place(place)
    for _ in range(limits.SIZES_STEPS):
        weights = geometry.weights(left + table @ (best.ratio * best.solution), best.scale)
        law = _by_law(best, random.law, n)
        again = solved(replace(best.sizes, laws=law), best.scale, weighted_by(weights))
        if again.score <= best.score:
            break
        gain, best = again.score - best.score, again
        if gain < limits.SIZES_GAIN:
            break
    return replace(best, table=table * best.ratio)


def _by_law(found: _Chosen, law: Sequence[str], first: int) -> dict[str, float]:
    """How many times the error that its accuracy allows each law has, a step nearer to where the
    recording is most probable; `first` is the place of the first of them in the solution.

    Source: MacKay 1992, chapter 4: re-estimate by the number of values that the data determine.
    """
    lower, size = found.spread
    doubt = np.diag(dpotri(lower, lower=True)[0]) / size**2
    columns: dict[str, list[int]] = {}
    for i, name in enumerate(law, first):
        columns.setdefault(name, []).append(i)
    most = float(np.log(limits.FORM_KNOWN))
    known, times = most**-2, {}
    for name, at in columns.items():
        determined = len(at) - float(doubt[at].sum())
        square = float(np.sum(found.solution[at] ** 2))
        before = after = float(np.log(found.sizes.of([name])[0]))
        for _ in range(20):
            now = square * np.exp(-2.0 * (after - before))
            step = (now - determined - known * after) / (2.0 * now + known)
            after += float(np.clip(step, -1.0, 1.0))
        times[name] = float(np.exp(np.clip(after, -most, most)))
    return times


def _nearest(axis: Sequence[float], value: float) -> int:
    return int(np.argmin(np.abs(np.log(np.array(axis) / value))))


def climbed(
    score: Callable[[Place], float], begin: Place, lengths: Sequence[int], fresh: Collection[int]
) -> Place:
    """The best place of a grid that can be reached from another by steps along one axis.

    Axes in `fresh` are tried throughout first, all of their combinations.
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


def _joint(values: Array, forms: int, more: int) -> Array:
    """Precision of values, of errors of form and of those of the effects' forms."""
    n = len(values)
    joint = np.eye(n + forms + more)
    joint[:n, :n] = values
    return joint


def _weighed(
    geometry: Geometry,
    prior: Prior,
    random: Random,
    now: Fitted,
    begin: Begin,
    pressed: NDArray[np.bool_],
) -> Model:
    at = begin[0]
    more = forms_of_effects(geometry, now)
    found = _choose(geometry, prior, random, now, begin, more, (), pressed)
    known = prior.near(at)
    off = (at - known.mean) * ~pressed
    jacobian = now.jacobian[geometry.seen]
    # The normal density of the linear solution gives way to that of the Student distribution.
    evidence = found.score + known.density + 0.5 * float(off @ known.precision @ off)
    evidence -= len(random.terms) * float(np.log(len(limits.TERM_SIZES)))
    return Model(
        fitted=now,
        prior=prior,
        mean=known.mean,
        at=at,
        forms=begin[1],
        terms=random.terms,
        sizes=found.sizes,
        scale=found.scale,
        evidence=evidence,
        table=found.table,
        left=now.residual[geometry.seen] - jacobian @ off,
        precision=_joint(known.precision, random.count, more.shape[1]),
        weights=found.weights,
    )
