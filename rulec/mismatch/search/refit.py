"""Refit a set of explanations, and its evidence by Laplace's approximation.

Errors of the outputs follow a Student distribution per point. In addition each law may have an
error of form, which is smooth over its arguments and within a factor of two of its stated accuracy:
a law with a larger error lacks something, however smooth the error is.

Source: MacKay 1992 (evidence); Kennedy and O'Hagan 2001 (error of form as a Gaussian process).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular
from scipy.linalg.lapack import dpotri
from scipy.special import erfcx

from rulec.knowledge.parameter_belief import LocalBelief
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.configuration import ERROR, Configuration
from rulec.mismatch.evidence.evidence import (
    USUAL,
    Evidence,
    Index,
    Noise,
    Point,
    Random,
    Sizes,
    climbed,
)
from rulec.mismatch.evidence.prior import Prior
from rulec.mismatch.evidence.term import Term
from rulec.mismatch.search import limits


@dataclass(frozen=True, kw_only=True)
class Model:
    """A refitted set of explanations.

    `at` are the coordinates of the values, `mean` is the mean of their prior, linearised there.
    `table`, shape (rows, values), has the whitened slopes by the values, errors of form and errors
    of form of effects; `left`, shape (rows,), is the whitened residual at the means of the values;
    `raw` and `off` are both before whitening. `precision` is that of the prior, `weights` are those
    of the rows. `evidence` is the log marginal likelihood.
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

    def under(self, evidence: Evidence, noise: Noise) -> Model:
        """The same model at the same values under another noise, with all rows weighted alike."""
        table, left = evidence.whitened(self.raw, noise), evidence.whitened(self.off, noise)
        return replace(self, noise=noise, table=table, left=left, weights=evidence.alike(noise))

    @cached_property
    def normal(self) -> tuple[Array, Array]:
        """The normal matrix of all unknowns, scaled to a unit diagonal, and the roots of that
        diagonal, shape (unknowns,)."""
        normal = self.table.T @ (self.table * self.weights[:, None]) + self.precision
        unit = np.sqrt(np.diag(normal))
        return normal / np.outer(unit, unit), unit

    def rest(self) -> Array:
        """The residual after a linear refit, shape (rows,)."""
        return np.asarray(self.off + self.raw @ self.solved[0])

    @cached_property
    def _imitating(self) -> Array:
        """Map from whitened rows to what all unknowns imitate of them, shape (unknowns, rows)."""
        scaled, unit = self.normal
        factor = np.linalg.cholesky(scaled + 1e-12 * np.eye(len(unit)))
        return np.asarray(
            solve_triangular(factor, (self.table / unit).T * self.weights, lower=True)
        )

    def alone(self, rows: Array) -> Array:
        """Further whitened columns, shape (rows, n), weighted, without what all unknowns of the
        model imitate of them."""
        imitating = self._imitating
        return np.asarray(rows * self.weights[:, None] - imitating.T @ (imitating @ rows))

    def beside(self, rows: Array) -> tuple[Array, Array]:
        """Normal matrix and moment of further whitened columns, shape (rows, n), with all unknowns
        of the model refitted beside them."""
        alone = self.alone(rows)
        return rows.T @ alone, alone.T @ self.left

    @property
    def setting(self) -> Configuration:
        """The joined candidates and all values."""
        return self.point.setting

    @property
    def scale(self) -> float:
        """Size of the noise relative to the expected one."""
        return self.noise[0]

    @cached_property
    def inverse(self) -> Array:
        """Covariance of the values, in coordinates, and of the amounts of random columns."""
        scaled, unit = self.normal
        return np.asarray(np.linalg.pinv(scaled, hermitian=True) / np.outer(unit, unit))

    @cached_property
    def solved(self) -> tuple[Array, Array]:
        """All unknowns less their prior means, shape (unknowns,), and their covariance, shape
        (unknowns, unknowns)."""
        return -self.inverse @ (self.table.T @ (self.left * self.weights)), self.inverse

    def columns_of(self, term: Term) -> NDArray[np.intp]:
        """Indices of a term's functions among the unknowns: behind values and errors of form and of
        sensors, in the order of `Random`."""
        before = len(self.at) + len(self.forms)
        for other in self.terms[self.terms.index(term) :]:
            before -= other.columns.shape[1]
        return np.arange(before, before + term.columns.shape[1])

    def size_of(self, term: Term) -> float:
        """Size of the functions of a term, SI of its place."""
        return self.sizes.terms[self.terms.index(term)] / term.norm

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the values, SI, shape (values, values)."""
        step, n = self.prior.coordinates.slopes(self.at), len(self.at)
        return np.asarray(self.inverse[:n, :n] * np.outer(step, step))


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
    """Whitened slopes by all unknowns, the residual without them, and the weights of the rows; with
    the normal matrix and the moment that follow."""

    table: Array
    left: Array
    weights: Array

    @cached_property
    def normal(self) -> Array:
        return np.asarray(self.table.T @ (self.table * self.weights[:, None]))

    @cached_property
    def moment(self) -> Array:
        return np.asarray(self.table.T @ (self.weights * self.left))


def refitted(
    evidence: Evidence,
    setting: Configuration,
    near: Model | None = None,
    terms: tuple[Term, ...] = (),
    without_error: Collection[str] = (),
) -> Model:
    """Refit all values and errors of form, starting from `near`, a similar model.

    Sensors `without_error` have no error: users of the plant read the same sensors.

    Raises `numpy.linalg.LinAlgError` where the model has no finite slopes at the start.
    """
    prior = evidence.prior(setting)
    held = np.isin(prior.names, [ERROR + name for name in without_error])
    low, high = (np.where(held, 0.0, end) for end in (prior.lowest, prior.highest))
    prior = replace(prior, lowest=low, highest=high)
    n = len(prior.names)
    at = np.clip(prior.of(setting.values), prior.lowest, prior.highest)
    random = Random(evidence.forms, evidence.law, evidence.moving, evidence.held, terms)
    forms, sizes, noise, own = np.zeros(random.count), USUAL, evidence.usual_noise, {}
    if near is not None:
        count = min(len(forms), len(near.forms))
        forms[:count] = near.forms[:count]
        sizes, noise = near.sizes, near.noise
        own = {t.name: size for t, size in zip(near.terms, sizes.terms, strict=True)}
    sizes = replace(sizes, terms=tuple(own.get(t.name, 1.0) for t in terms))
    fresh = [len(noise) + 1 + i for i, t in enumerate(terms) if t.name not in own]
    fresh += [0] if near is None else []
    problem, at_bound = _Problem(evidence, prior, random), np.zeros(n, dtype=bool)
    now = evidence.evaluated(setting, prior, at)
    if not (np.isfinite(now.residual).all() and np.isfinite(now.jacobian).all()):
        raise np.linalg.LinAlgError("the model has no finite slopes where the refit begins")
    damping, cost = 1e-3, np.inf
    for step in range(limits.REFIT_STEPS):
        if step in (0, 4):
            found = problem.chosen(now, (at, forms, sizes, noise), held, fresh=fresh)
            sizes, noise, forms, fresh = found.sizes, found.noise, found.solution[n:], []
            loads = random.columns * random.ratio(sizes)
            cost = problem.cost(now, at, forms, loads, noise)
        residual = evidence.whitened(now.residual + loads @ forms, noise)
        table = evidence.whitened(np.concatenate([now.jacobian, loads], axis=1), noise)
        weights = evidence.weights(residual, noise)
        local, precision = prior.near(at), np.eye(table.shape[1])
        precision[:n, :n] = local.precision
        normal = table.T @ (table * weights[:, None]) + precision
        slope = table.T @ (weights * residual)
        slope += precision @ np.concatenate([at - local.mean, forms])
        stopped = np.zeros(len(slope), dtype=bool)
        stopped[:n] = (at <= prior.lowest) & (slope[:n] > 0)
        stopped[:n] |= (at >= prior.highest) & (slope[:n] < 0)
        stopped[:n] |= held
        free, at_bound = np.flatnonzero(~stopped), stopped[:n]
        size = np.sqrt(np.diag(normal))[free]
        scaled = normal[np.ix_(free, free)] / np.outer(size, size)
        gain = -1.0
        for _ in range(10):
            change = np.zeros(len(slope))
            damped = scaled + damping * np.eye(len(free))
            change[free] = -np.linalg.solve(damped, slope[free] / size) / size
            there = np.clip(at + change[:n], prior.lowest, prior.highest)
            moved = forms + change[n:]
            trial = evidence.evaluated(setting, prior, there)
            after = problem.cost(trial, there, moved, loads, noise)
            gain = cost - after if np.isfinite(after) else -1.0
            if gain >= -1e-9:
                at, forms, now, cost = there, moved, trial, after
                damping = max(damping / 8.0, 1e-9)
                break
            damping = max(damping, 1e-6) * 8.0
        if gain < evidence.ended:
            break
    return problem.weighed(now, (at, forms, sizes, noise), at_bound)


Begin = tuple[Array, Array, Sizes, Noise]
"""Values, amounts of random columns, their sizes, and the noise to start from."""


@dataclass(frozen=True)
class _Problem:
    """The refit of one model: its prior, and its random columns."""

    evidence: Evidence
    prior: Prior
    random: Random

    def cost(self, now: Point, at: Array, forms: Array, loads: Array, noise: Noise) -> float:
        """Negative log density at some values and amounts of random columns, nats."""
        residual = self.evidence.whitened(now.residual + loads @ forms, noise)
        likelihood = self.evidence.likelihood(residual, noise)
        return -likelihood - self.prior.near(at).density + 0.5 * float(forms @ forms)

    def chosen(
        self,
        now: Point,
        begin: Begin,
        at_bound: NDArray[np.bool_],
        effects: Array | None = None,
        fresh: Collection[int] = (),
    ) -> _Chosen:
        """Sizes of random columns and noise under which the recording is most probable.

        The search climbs from the given noise or from one that the residual makes likely, if that
        is likelier. `effects` are columns of errors of form of effects. `fresh` are axes
        whose sizes are not known from a similar model: all their values are tried, the other axes
        are climbed. Values `at_bound`, at an end of their range, stay there.
        """
        evidence, prior, random = self.evidence, self.prior, self.random
        at, forms, sizes, noise = begin
        more = np.zeros((evidence.count, 0)) if effects is None else effects
        n = len(at)
        local = prior.near(at)
        jacobian, off = now.jacobian * ~at_bound, (at - local.mean) * ~at_bound
        left = now.residual - jacobian @ off
        table = np.concatenate([jacobian, random.columns, more], axis=1)
        precision = block_diag(local.precision, np.eye(random.count + more.shape[1]))
        start = np.concatenate([off, random.ratio(sizes) * forms, np.zeros(more.shape[1])])
        moves = random.moving.shape[1] > 0
        axes: list[tuple[float, ...]] = [*evidence.noises]
        axes += [common.MOVING_SHARES if moves else (common.USUAL_MOVING,)]
        axes += [common.TERM_SIZES] * len(sizes.terms)
        whole_of, left_of = evidence.whitener(table), evidence.whitener(left)

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
            score = evidence.likelihood(residual, noise) - 0.5 * float(
                solution @ precision @ solution
            )
            score -= float(np.sum(np.log(np.diag(factor[0]))) + np.sum(np.log(size)))
            score += sizes.odds + evidence.noise_odds(noise)
            score += sum(map(Term.odds, random.terms, sizes.terms))
            return _Chosen(score, sizes, noise, solution, weighted, ratio, spread=(factor[0], size))

        @cache
        def weighted_at(noise: Noise) -> _Weighted:
            whole, rest = whole_of(noise), left_of(noise)
            return _Weighted(whole, rest, evidence.weights(rest + whole @ start, noise))

        @cache
        def at_index(index: Index) -> _Chosen:
            values = [axis[i] for axis, i in zip(axes, index, strict=True)]
            own = tuple(values[: len(noise)])
            moving, *of_terms = values[len(noise) :]
            return solved(Sizes(moving, tuple(of_terms), sizes.laws), own, weighted_at(own))

        rest = left + table @ start
        likely = (noise, *evidence.likely_noises(rest))
        ways = [(*each, sizes.moving, *sizes.terms) for each in likely]
        first = max(
            (tuple(map(_nearest, axes, way)) for way in ways), key=lambda p: at_index(p).score
        )
        index = climbed(lambda p: at_index(p).score, first, [len(axis) for axis in axes], fresh)
        best = at_index(index)
        for _ in range(limits.SIZES_STEPS):
            own = best.weighted
            residual = own.left + own.table @ (best.ratio * best.solution)
            own = _Weighted(own.table, own.left, evidence.weights(residual, best.noise))
            law = _by_law(best, random.law, n)
            again = solved(replace(best.sizes, laws=law), best.noise, own)
            if again.score <= best.score:
                break
            gain, best = again.score - best.score, again
            if gain < limits.SIZES_GAIN:
                break
        return best

    def weighed(self, now: Point, begin: Begin, at_bound: NDArray[np.bool_]) -> Model:
        """The model at some values, of which some are `at_bound`, at an end of their range."""
        evidence, prior, random = self.evidence, self.prior, self.random
        at = begin[0]
        more = evidence.effect_forms(now)
        found = self.chosen(now, begin, at_bound, more)
        local = prior.near(at)
        off = (at - local.mean) * ~at_bound
        left = now.residual - now.jacobian @ off
        # Replace the normal density of the linear solution by that of the Student distribution.
        log_evidence = found.score + local.density + 0.5 * float(off @ local.precision @ off)
        log_evidence -= len(random.terms) * float(np.log(len(common.TERM_SIZES)))
        ends = np.flatnonzero(at_bound & (prior.lowest < prior.highest))
        if len(ends):
            log_evidence += _at_ends(evidence, found, now.jacobian[:, ends], local, at, ends)
        return Model(
            point=now,
            prior=prior,
            mean=local.mean,
            at=at,
            forms=begin[1],
            terms=random.terms,
            sizes=found.sizes,
            noise=found.noise,
            evidence=log_evidence,
            table=found.weighted.table * found.ratio,
            left=evidence.whitened(left, found.noise),
            raw=np.concatenate([now.jacobian * ~at_bound, random.columns, more], axis=1)
            * found.ratio,
            off=left,
            precision=block_diag(local.precision, np.eye(random.count + more.shape[1])),
            weights=found.weighted.weights,
        )


def _by_law(found: _Chosen, law: Sequence[str], first: int) -> dict[str, float]:
    """Error of each law in units of what its accuracy allows, one step closer to the most probable.

    `first` is the index of the first error of form in the solution.

    Source: MacKay 1992, chapter 4: re-estimate by the number of values that the data determine.
    """
    lower, size = found.spread
    variance = np.diag(dpotri(lower, lower=True)[0]) / size**2
    columns: dict[str, list[int]] = {}
    for i, name in enumerate(law, first):
        columns.setdefault(name, []).append(i)
    most = float(np.log(common.FORM_KNOWN))
    precision, times = most**-2, {}
    for name, at in columns.items():
        determined = len(at) - float(variance[at].sum())
        square = float(np.sum(found.solution[at] ** 2))
        before = after = float(np.log(found.sizes.of([name])[0]))
        for _ in range(20):
            now = square * np.exp(-2.0 * (after - before))
            step = (now - determined - precision * after) / (2.0 * now + precision)
            after += float(np.clip(step, -1.0, 1.0))
        times[name] = float(np.exp(np.clip(after, -most, most)))
    return times


def _nearest(axis: Sequence[float], value: float) -> int:
    return int(np.argmin(np.abs(np.log(np.array(axis) / value))))


def _at_ends(
    evidence: Evidence,
    found: _Chosen,
    slopes: Array,
    local: LocalBelief,
    at: Array,
    ends: NDArray[np.intp],
) -> float:
    """Gain in evidence, nats, because values at an end of their range can only move inwards, where
    the likelihood falls. `slopes`, shape (rows, ends), are those by the values at `ends`."""
    shown, own = evidence.whitened(slopes, found.noise), found.weighted
    table, (lower, size) = own.table * found.ratio, found.spread
    residual = own.left + table @ found.solution
    pull = shown.T * own.weights
    before = np.diag(local.precision)[ends]
    falls = np.abs(pull @ residual + (local.precision @ (at - local.mean))[ends])
    # All other values are refitted.
    beside = solve_triangular(lower, (pull @ table / size).T, lower=True)
    own_bends = before + np.einsum("er,re->e", pull, shown)
    bends = np.maximum(own_bends - np.sum(beside**2, axis=0), before)
    inside = 0.5 * erfcx(falls / np.sqrt(2.0 * bends)) * np.sqrt(before / bends)
    return float(np.sum(np.log(inside)))
