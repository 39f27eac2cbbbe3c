"""A set of explanations refitted, and its evidence by Laplace's approximation.

Errors of the outputs follow a Student distribution per point. Each law may besides be off by an
error of form that is smooth over its arguments, and as large as its accuracy says within a factor
of two: a law that is off by more has something missing, however smoothly.

Source: MacKay 1992 (evidence); Kennedy and O'Hagan 2001 (error of form as a Gaussian process).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.linalg.lapack import dpotri
from scipy.special import erfcx

from rulec.knowledge.belief import LocalBelief
from rulec.mismatch.evidence.steady.configuration import ERROR, Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, Prior
from rulec.mismatch.search import limits
from rulec.mismatch.search.evidence import USUAL, Evidence, Noise, Point, Random, Sizes, Term


@dataclass(frozen=True, kw_only=True)
class Model:
    """A refitted set of explanations.

    `at` are the coordinates of the values, `mean` what was known of them before as it counts there.
    `table` shape (rows, values) are slopes by the values, errors of form and errors of the
    effects' forms; `left`, shape (rows,), the residual at the means of the values; `precision` that
    of the prior, `weights` those of the rows. `evidence` is the log marginal likelihood.
    """

    point: Point
    prior: Prior
    mean: Array
    at: Array
    forms: Array
    terms: tuple[Term, ...]
    sizes: Sizes
    noise: Noise
    evidence: float
    table: Array
    left: Array
    precision: Array
    weights: Array
    raw: Array
    off: Array

    def under(self, geometry: Evidence, noise: Noise) -> Model:
        """The same model where it lies, with all rows alike as another noise would show them."""
        table, left = geometry.whitened(self.raw, noise), geometry.whitened(self.off, noise)
        return replace(self, noise=noise, table=table, left=left, weights=geometry.alike(noise))

    def rest(self) -> Array:
        """What it leaves, shape (rows,)."""
        weights, table = self.weights, self.table
        normal = table.T @ (table * weights[:, None]) + self.precision
        size = np.sqrt(np.diag(normal))
        moment = table.T @ (weights * self.left) / size
        found = np.linalg.solve(normal / np.outer(size, size), moment) / size
        rest: Array = self.off - self.raw @ found
        return rest

    @property
    def setting(self) -> Configuration:
        """What is joined, and all values."""
        return self.point.setting

    @property
    def fitted(self) -> Fitted:
        """The settled points as fitted."""
        fitted = getattr(self.point, "fitted", None)
        assert isinstance(fitted, Fitted)
        return fitted

    @property
    def scale(self) -> float:
        """Size of the noise in units of what was expected."""
        return self.noise[0]

    @cached_property
    def inverse(self) -> Array:
        """Covariance of all numbers, in coordinates, shape (values and random numbers,) twice."""
        normal = self.table.T @ (self.table * self.weights[:, None]) + self.precision
        size = np.sqrt(np.diag(normal))
        inverse: Array = np.linalg.pinv(normal / np.outer(size, size), hermitian=True)
        inverse /= np.outer(size, size)
        return inverse

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the values, SI, shape (values, values)."""
        step, n = self.prior.coordinates.slopes(self.at), len(self.at)
        covariance: Array = self.inverse[:n, :n] * np.outer(step, step)
        return covariance


@dataclass(frozen=True)
class _Chosen:
    """Sizes of random columns, noise, and the linear solution with them."""

    score: float
    sizes: Sizes
    noise: Noise
    solution: Array
    weighted: _Weighted
    ratio: Array
    spread: tuple[Array, Array]


@dataclass(frozen=True)
class _Weighted:
    """Rows of all numbers, and of what is left without them, as noise of some kind makes them
    independent; their weights; and the normal matrix and the moment that these give."""

    table: Array
    left: Array
    weights: Array

    @cached_property
    def normal(self) -> Array:
        normal: Array = self.table.T @ (self.table * self.weights[:, None])
        return normal

    @cached_property
    def moment(self) -> Array:
        moment: Array = self.table.T @ (self.weights * self.left)
        return moment


def refitted(
    geometry: Evidence,
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
    prior = geometry.prior(setting)
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
    noise = geometry.usual_noise if near is None else near.noise
    first = len(noise) + 1
    fresh = [first + i for i, name in enumerate(_names(terms)) if name not in own]
    fresh += [0] if near is None else []
    no_more = np.zeros((geometry.count, 0))
    pressed = np.zeros(n, dtype=bool)
    now = geometry.evaluated(setting, prior, at)
    if not (np.isfinite(now.residual).all() and np.isfinite(now.jacobian).all()):
        raise np.linalg.LinAlgError("the model has no finite slopes where the refit begins")
    damping, cost = 1e-3, np.inf
    for step in range(steps):
        if step in (0, 4):
            begin = at, forms, sizes, noise
            found = _choose(geometry, prior, random, now, begin, no_more, fresh, held, anew=True)
            sizes, noise, forms, fresh = found.sizes, found.noise, found.solution[n:], []
            loads = random.columns * random.ratio(sizes)
            cost = _cost(geometry, prior, now, at, forms, loads, noise)
        residual = geometry.whitened(now.residual + loads @ forms, noise)
        table = geometry.whitened(np.concatenate([now.jacobian, loads], axis=1), noise)
        weights = geometry.weights(residual, noise)
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
            trial = geometry.evaluated(setting, prior, there)
            after = _cost(geometry, prior, trial, there, moved, loads, noise)
            gain = cost - after if np.isfinite(after) else -1.0
            if gain >= -1e-9:
                at, forms, now, cost = there, moved, trial, after
                damping = max(damping / 8.0, 1e-9)
                break
            damping = max(damping, 1e-6) * 8.0
        if gain < geometry.ended:
            break
    return _weighed(geometry, prior, random, now, (at, forms, sizes, noise), pressed)


def _names(terms: Sequence[Term]) -> list[str]:
    return [term.name for term in terms]


def _cost(
    geometry: Evidence,
    prior: Prior,
    now: Point,
    at: Array,
    forms: Array,
    loads: Array,
    noise: Noise,
) -> float:
    residual = geometry.whitened(now.residual + loads @ forms, noise)
    likelihood = geometry.likelihood(residual, noise)
    return -likelihood - prior.near(at).density + 0.5 * float(forms @ forms)


Begin = tuple[Array, Array, Sizes, Noise]
"""Values, random numbers, their sizes, and the noise to begin with."""

Place = tuple[int, ...]
"""Indices of what the noise is like, and of all sizes."""


def _choose(
    geometry: Evidence,
    prior: Prior,
    random: Random,
    now: Point,
    begin: Begin,
    more: Array,
    fresh: Collection[int],
    pressed: NDArray[np.bool_] | None = None,
    *,
    anew: bool = False,
) -> _Chosen:
    """Sizes of random columns and noise under which the recording is most probable.

    What noise is like is climbed from where it was or, `anew`, from what is likely by what is
    left, if that is likelier. `more` are columns of errors of the effects' own forms; `fresh` axes
    whose sizes are not known from a model that is much alike: these are tried throughout, the
    others climbed. Values that are `pressed` to an end of their range stay there.
    """
    at, forms, sizes, noise = begin
    n = len(at)
    jacobian = now.jacobian
    known = prior.near(at)
    off = at - known.mean
    if pressed is not None:
        jacobian, off = jacobian * ~pressed, off * ~pressed
    left = now.residual - jacobian @ off
    table = np.concatenate([jacobian, random.columns, more], axis=1)
    precision = _joint(known.precision, random.count, more.shape[1])
    start = np.concatenate([off, random.ratio(sizes) * forms, np.zeros(more.shape[1])])
    moves = random.moving.shape[1] > 0
    axes: list[tuple[float, ...]] = [*geometry.noises]
    axes += [limits.MOVING_SHARES if moves else (limits.USUAL_MOVING,)]
    axes += [limits.TERM_SIZES] * len(sizes.terms)

    whole_of, left_of = geometry.whitener(table), geometry.whitener(left)

    def solved(sizes: Sizes, noise: Noise, weighted: _Weighted) -> _Chosen:
        ratio = np.ones(len(precision))
        ratio[n : n + random.count] = random.ratio(sizes)
        ratio[n + random.count :] = limits.EFFECT_FORM
        whole = ratio[:, None] * weighted.normal * ratio + precision
        size = np.sqrt(np.diag(whole))
        whole /= size[:, None] * size
        whole[np.diag_indices(len(size))] += 1e-13
        factor = cho_factor(whole, lower=True, overwrite_a=True, check_finite=False)
        moment = weighted.moment * ratio / size
        solution = -cho_solve(factor, moment, check_finite=False) / size
        residual = weighted.left + weighted.table @ (ratio * solution)
        score = geometry.likelihood(residual, noise) - 0.5 * float(solution @ precision @ solution)
        score -= float(np.sum(np.log(np.diag(factor[0]))) + np.sum(np.log(size)))
        score += sizes.odds + geometry.noise_odds(noise)
        return _Chosen(score, sizes, noise, solution, weighted, ratio, spread=(factor[0], size))

    @cache
    def weighted_at(noise: Noise) -> _Weighted:
        whole, rest = whole_of(noise), left_of(noise)
        return _Weighted(whole, rest, geometry.weights(rest + whole @ start, noise))

    @cache
    def at_place(place: Place) -> _Chosen:
        values = [axis[i] for axis, i in zip(axes, place, strict=True)]
        own = tuple(values[: len(noise)])
        moving, *of_terms = values[len(noise) :]
        return solved(Sizes(moving, tuple(of_terms), sizes.laws), own, weighted_at(own))

    rest = left + table @ start
    likely = (noise, *(geometry.likely_noises(rest) if anew else ()))
    ways = [(*each, sizes.moving, *sizes.terms) for each in likely]
    first = max((tuple(map(_nearest, axes, way)) for way in ways), key=lambda p: at_place(p).score)
    place = climbed(lambda p: at_place(p).score, first, [len(axis) for axis in axes], fresh)
    best = at_place(place)
    for _ in range(limits.SIZES_STEPS):
        own = best.weighted
        residual = own.left + own.table @ (best.ratio * best.solution)
        own = _Weighted(own.table, own.left, geometry.weights(residual, best.noise))
        law = _by_law(best, random.law, n)
        again = solved(replace(best.sizes, laws=law), best.noise, own)
        if again.score <= best.score:
            break
        gain, best = again.score - best.score, again
        if gain < limits.SIZES_GAIN:
            break
    return best


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
    geometry: Evidence,
    prior: Prior,
    random: Random,
    now: Point,
    begin: Begin,
    pressed: NDArray[np.bool_],
) -> Model:
    at = begin[0]
    more = geometry.effect_forms(now)
    found = _choose(geometry, prior, random, now, begin, more, (), pressed)
    known = prior.near(at)
    off = (at - known.mean) * ~pressed
    left = now.residual - now.jacobian @ off
    # The normal density of the linear solution gives way to that of the Student distribution.
    evidence = found.score + known.density + 0.5 * float(off @ known.precision @ off)
    evidence -= len(random.terms) * float(np.log(len(limits.TERM_SIZES)))
    ends = np.flatnonzero(pressed & (prior.lowest < prior.highest))
    if len(ends):
        evidence += _at_ends(geometry, found, now.jacobian[:, ends], known, at, ends)
    return Model(
        point=now,
        prior=prior,
        mean=known.mean,
        at=at,
        forms=begin[1],
        terms=random.terms,
        sizes=found.sizes,
        noise=found.noise,
        evidence=evidence,
        table=found.weighted.table * found.ratio,
        left=geometry.whitened(left, found.noise),
        raw=np.concatenate([now.jacobian * ~pressed, random.columns, more], axis=1) * found.ratio,
        off=left,
        precision=_joint(known.precision, random.count, more.shape[1]),
        weights=found.weighted.weights,
    )


def _at_ends(
    geometry: Evidence,
    found: _Chosen,
    slopes: Array,
    known: LocalBelief,
    at: Array,
    ends: NDArray[np.intp],
) -> float:
    """What the evidence gains, nats, as a value at an end of its range only moves inwards, where
    the likelihood falls; `slopes`, shape (rows, ends), are those by the values at `ends`."""
    shown, own = geometry.whitened(slopes, found.noise), found.weighted
    table, (lower, size) = own.table * found.ratio, found.spread
    residual = own.left + table @ found.solution
    pull = shown.T * own.weights
    before = np.diag(known.precision)[ends]
    falls = np.abs(pull @ residual + (known.precision @ (at - known.mean))[ends])
    # All other values follow.
    beside = solve_triangular(lower, (pull @ table / size).T, lower=True)
    own_bends = before + np.einsum("er,re->e", pull, shown)
    bends = np.maximum(own_bends - np.sum(beside**2, axis=0), before)
    inside = 0.5 * erfcx(falls / np.sqrt(2.0 * bends)) * np.sqrt(before / bends)
    return float(np.sum(np.log(inside)))
