"""Test hypotheses by undoing their faults: which degrees make all estimates agree best?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.chi_square import ChiSquare, Metric, inverse_information
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, Scales, in_a_row

Faults = tuple[FaultSpec, ...]
"""The simultaneous faults of one hypothesis."""


class Outcomes(NamedTuple):
    """Per hypothesis and problem: best degrees and their standard uncertainties, both of shape
    (faults, hypotheses, n), chi-square left and log-likelihood, (hypotheses, n). If a hypothesis
    touches no usable observer, or was not tried: 0, inf, inf and -inf."""

    degree: Array
    u: Array
    distance: Array
    evidence: Array


def fit(
    test: HypothesisTest,
    hypotheses: Sequence[Faults],
    tried: np.ndarray | None = None,
    starts: Array | None = None,
) -> Outcomes:
    """Fit the degrees of hypotheses, all with the same number of faults, to many problems at once:
    each has few numbers, and one call of numpy serves all of them.

    Parameters
    ----------
    tried : shape (hypotheses, n), which of them to try on which problems; default all.
    starts : initial degrees, shape (faults, starts, hypotheses, n); default by the faults.
    """
    shape = (len(hypotheses), len(test))
    count = len(hypotheses[0]) if hypotheses else 1
    degree, u = np.zeros((count, *shape)), np.full((count, *shape), np.inf)
    found = Outcomes(degree, u, np.full(shape, np.inf), np.full(shape, -np.inf))
    size = max(limits.TABLE // max(test.freedom**2, 1), 1)
    for i, faults in enumerate(hypotheses):
        begin = _starts(faults) if starts is None else starts[:, :, i]
        begin = np.broadcast_to(begin, (*begin.shape[:2], len(test)))
        touched = test.touched(faults)
        # Not where a fault would affect a reading that was removed.
        unread = [test.unread(fault) & (test.present > 0.0) for fault in faults]
        asked = ~np.any(unread, axis=(0, 1)) & (True if tried is None else tried[i])
        problems = np.flatnonzero(asked) if touched else np.zeros(0, dtype=int)
        for at in (problems[low : low + size] for low in range(0, len(problems), size)):
            search = DegreeSearch(test=test.at(at), faults=faults, touched=touched)
            outcome = search.outcome(test.metric.problems(at), begin[:, :, at])
            found.degree[:, i, at], found.u[:, i, at] = outcome[:2]
            found.distance[i, at], found.evidence[i, at] = outcome[2:]
    return found


def _starts(faults: Faults) -> Array:
    """Initial degrees, shape (faults, starts, 1): of one fault zero and those in its range."""
    if len(faults) > 1:
        return pair_starts()[:, :, 0]
    (fault,) = faults
    low = fault.lowest / fault.scale
    top = fault.highest * (1.0 - common.BELOW_HIGHEST) / fault.scale
    starts = np.array(limits.FIT_STARTS)
    own = starts[(starts == 0.0) | ((low < starts) & (top > starts))]
    return np.asarray(own[None, :, None] * fault.scale)


def pair_starts() -> Array:
    """Initial degrees of two faults, shape (2, starts, 1, 1)."""
    both = [(a, b) for a in limits.PAIR_STARTS for b in limits.PAIR_STARTS]
    return np.array(both).T[:, :, None, None]


@dataclass(frozen=True, kw_only=True)
class DegreeSearch:
    """A hypothesis tried on n problems; `touched` are the usable observers that its faults bias."""

    test: HypothesisTest
    faults: Faults
    touched: tuple[str, ...]

    def outcome(self, metric: Metric, starts: Array) -> tuple[Array, Array, Array, Array]:
        """Best degrees and their uncertainties, shape (faults, n), chi-square left and
        log-likelihood, shape (n,); `starts` of shape (faults, starts, n)."""
        pure = metric.moving(self.rows)
        best = self._fit(pure, self._point(pure, self._best_start(pure, starts)))
        # Not for a change of the liquid that runs off: no small one leaves as little.
        far = np.flatnonzero(~self._believed(best.degree))
        if len(far) and len(self.faults) == 1 and self.faults[0].module:
            some, own = self.at(far), pure.problems(far)
            best.enter(far, some._point(own, some._small(starts[..., far])))
        # A fault changes the errors of a flow along with the flow.
        pure = self.test.rescaled(self.scales(best.degree), self.rows)
        best = best.judged_by(pure)
        again = self._fit(pure, best)
        best = best.where(self._believed(again.degree), again)
        # Degree and uncertainty are those of the pure law; only the goodness of fit uses the
        # tolerance of the law.
        widened = pure.tolerating(self._tolerance(best.degree))
        left = self._fit(widened, best.judged_by(widened)).distance
        information = pure.information(best.effect)
        u = spread_of(information)
        usable = np.isfinite(left) & np.isfinite(u).all(axis=0) & self._believed(best.degree)
        if len(u) > 1:
            usable &= distinguishable(information)
        # Nor must the tolerance count against a fault: no penalty for the wider covariance.
        evidence = np.where(usable, -0.5 * left, -np.inf)
        believed = usable if len(u) > 1 else self._believed(best.degree)
        distance = np.where(believed, left, np.inf)
        return best.degree, u, distance, evidence

    def at(self, chosen: np.ndarray) -> DegreeSearch:
        """The same on some of the problems."""
        return replace(self, test=self.test.at(chosen))

    @cached_property
    def rows(self) -> list[int]:
        """Rows of the touched flows among the usable ones."""
        return [self.test.rows[name] for name in self.touched]

    def moved(self, degree: Array) -> Array:
        """How far undoing the faults moves the touched flows, (touched, ..., points, n), m3/s, at
        degrees (faults, ..., points, n)."""
        return self._undone(degree, ())[0]

    def moved_and_slopes(self, degree: Array) -> tuple[Array, Array]:
        """The same, and the slopes by each degree, shape (touched, faults, points, n); degrees
        (faults, points, n)."""
        return self._undone(degree, tuple(fault.id for fault in self.faults))

    def _undone(self, degree: Array, slopes: tuple[str, ...]) -> tuple[Array, Array]:
        """The same with `slopes` by the degrees of some faults."""
        plan, shape = self.test.ruleset.undone(self.touched, slopes), degree.shape[1:]
        inputs: dict[str, Array | float] = {n: 0.0 for n in plan.used_inputs if n.startswith("x:")}
        inputs |= {f"x:{f.id}": own.ravel() for f, own in zip(self.faults, degree, strict=True)}
        for name in plan.used_inputs & self._readings.keys():
            inputs[name] = np.broadcast_to(self._readings[name], shape).ravel()
        out = {name: one.reshape(shape) for name, one in plan.run(inputs).items()}
        # The baseline leaves a share of each, as its correction scales with an estimate.
        left = self.test.share_left(self.faults, self.touched)
        each = zip(self.touched, self.test.flows[self.rows], left, strict=True)
        moved = np.array([(out[f"q:{o}"] - flow) * share for o, flow, share in each])
        none = np.zeros(shape)
        steep = [[out.get(f"dq:{o}:{name}", none) for name in slopes] for o in self.touched]
        return moved, np.array(steep) * left[:, None] if slopes else none

    @cached_property
    def _readings(self) -> Mapping[str, Array]:
        """Readings per signal, shape (points, n), SI."""
        return self.test.readings(self.test.ruleset.undo.used_inputs)

    @cached_property
    def _range(self) -> tuple[Array, Array]:
        """Lowest and highest degree, shape (faults, 1)."""
        lowest, highest = (self._of_faults(name) for name in ("lowest", "highest"))
        return lowest, highest * (1.0 - common.BELOW_HIGHEST)

    def _believed(self, degree: Array) -> np.ndarray:
        """Whether all degrees of a problem, shape (faults, n), are credible."""
        return np.asarray((degree < self._of_faults("credible")).all(axis=0))

    def _of_faults(self, name: str) -> Array:
        """An attribute of the faults, shape (faults, 1)."""
        return np.array([[float(getattr(fault, name))] for fault in self.faults])

    def _everywhere(self, degree: Array) -> Array:
        """Degrees of the columns, (faults, ..., n), at all points: (faults, ..., points, n)."""
        return np.asarray(degree[..., None, :] * self.test.present)

    def _small(self, starts: Array) -> Array:
        """The first credible degree, of shape (1, starts, n), ascending from 0, that leaves as
        little as the best, within its 95 % bounds: (1, n); the highest if none does. Errors shrink
        with the flows: at an extreme degree a law may remove both the disagreement and all
        uncertainty."""
        tried = np.where(starts < self._of_faults("credible")[:, None], starts, 0.0)
        left = []
        for degree in np.moveaxis(tried, 1, 0):
            scale = self._scale(degree)
            chi = self.test.rescaled(Scales(scale, scale), self.rows)
            left.append(self._point(chi, degree).distance)
        first = np.argmax(left <= np.min(left, axis=0) + common.COVERAGE**2, axis=0)
        small: Array = np.take_along_axis(tried, first[None, None], axis=1)[:, 0]
        return np.where(small > 0.0, small, self._range[1])

    def _best_start(self, chi: ChiSquare, starts: Array) -> Array:
        """The best of some degrees, shape (faults, starts, n), for each problem: (faults, n)."""
        low, top = self._range
        degree = np.clip(starts, low[:, None], top[:, None])
        distance, _ = chi.at(in_a_row(self.moved(self._everywhere(degree))))
        best = np.argmin(finite(distance), axis=0)
        return np.asarray(np.take_along_axis(degree, best[None, None], axis=1)[:, 0])

    def _point(self, chi: ChiSquare, degree: Array) -> SearchPoint:
        """Chi-square with the faults undone at degrees, shape (faults, n)."""
        moved, slopes = self.moved_and_slopes(self._everywhere(degree))
        moved, effect = in_a_row(moved), in_a_row(slopes * self.test.present)
        distance, slope = chi.at(moved)
        return SearchPoint(degree, moved, slope, effect, finite(distance))

    def _fit(self, chi: ChiSquare, begin: SearchPoint) -> SearchPoint:
        """Degrees of least distance: Gauss-Newton with halved steps."""
        search, best, left = self, begin, np.arange(len(self.test))
        low, top = self._range
        share = np.ones(len(left))
        found = begin.problems(left)
        for _ in range(limits.FIT_STEPS):
            degree = np.clip(best.degree + share * newton_step(chi, best), low, top)
            next_one = search._point(chi, degree)
            better = next_one.is_better(best)
            moved = np.max(np.abs(degree - best.degree), axis=0, initial=0.0)
            best = best.where(better, next_one)
            share = np.where(better, 1.0, 0.5 * share)
            going = moved >= limits.FIT_CONVERGED
            if not going.all():
                found.enter(left[~going], best.problems(~going))
                left, share, best = left[going], share[going], best.problems(going)
                if not len(left):
                    return found
                search, chi = search.at(going), chi.problems(going)
        found.enter(left, best)
        return found

    def scales(self, degree: Array) -> Scales:
        """Factors by which undoing the faults scales the errors of each usable flow.

        Noise is that of the readings as they are: undoing scales it. A systematic error is that of
        a sound sensor: a fault that scales a reading scales it too, and undoing restores it.
        """
        outside = 1.0 - self._of_faults("in_sensor")
        noise = self._scale(degree)
        sensors = tuple(name for f in self.faults if f.in_sensor for name in f.scales)
        return Scales(noise, noise if outside.all() else self._scale(degree * outside), sensors)

    def _scale(self, degree: Array) -> Array:
        """Undone over measured flow of each usable observer, shape (usable, points, n).

        Errors of an estimate scale like that where a law acts as a factor, and nearly so elsewhere.
        """
        flows = self.test.flows
        scale = np.ones_like(flows)
        moved = self.moved(self._everywhere(degree))
        with np.errstate(divide="ignore", invalid="ignore"):
            scale[self.rows] += moved / flows[self.rows]
        most = limits.LARGEST_SCALE
        return np.where(np.isfinite(scale), np.clip(scale, -most, most), 1.0)

    def _tolerance(self, degree: Array) -> Array:
        """Covariance of the touched flows by the tolerance of each fault, shape (flows, flows, n):
        a real fault never follows its law exactly.

        The effect on each observer may be off by the tolerance, independently of the other
        observers, but equally at all points of one problem.
        """
        count, tolerance = len(degree), self._of_faults("tolerance")
        # As found, then without each of the faults.
        tried = np.repeat(degree[:, None], count + 1, axis=1)
        tried[range(count), range(1, count + 1)] = 0.0
        moved = self.moved(self._everywhere(tried))
        touched, _, points, n = moved.shape
        same = np.tile(np.eye(touched), (points, points))[:, :, None]
        covariance = np.zeros((points * touched, points * touched, n))
        for i in range(count):
            off = in_a_row(tolerance[i] * (moved[:, 0] - moved[:, i + 1]))
            covariance += same * off[:, None] * off
        return covariance


class SearchPoint(NamedTuple):
    """A point of the search, n problems last.

    Degrees (faults, n), movement of the flows and half the slope of chi-square there, both (flows,
    n), effect of the degrees on the flows (flows, faults, n), chi-square (n,).
    """

    degree: Array
    moved: Array
    slope: Array
    effect: Array
    distance: Array

    def judged_by(self, chi: ChiSquare) -> SearchPoint:
        """The same point with another chi-square."""
        distance, slope = chi.at(self.moved)
        return self._replace(slope=slope, distance=finite(distance))

    def is_better(self, other: SearchPoint) -> np.ndarray:
        """Whether chi-square is less than at another point, shape (n,).

        The difference of a quadratic between two points is exact in the slopes; a difference of
        values would lose the last steps of the search in rounding.
        """
        gain = np.einsum("in,in->n", self.moved - other.moved, self.slope + other.slope)
        return np.asarray(np.isfinite(self.distance) & (gain < 0))

    def where(self, better: np.ndarray, other: SearchPoint) -> SearchPoint:
        """Take over the problems where `other` is better."""
        if better.all():
            return other
        return SearchPoint(*(np.where(better, b, a) for a, b in zip(self, other, strict=True)))

    def problems(self, chosen: np.ndarray) -> SearchPoint:
        """Some of the problems."""
        return SearchPoint(*(own[..., chosen] for own in self))

    def enter(self, chosen: np.ndarray, found: SearchPoint) -> None:
        """Write results of some of the problems."""
        for own, new in zip(self, found, strict=True):
            own[..., chosen] = new


def newton_step(chi: ChiSquare, point: SearchPoint) -> Array:
    """Gauss-Newton change of the degrees, shape (faults, n); 0 where there is none."""
    pull = -np.einsum("idn,in->dn", point.effect, point.slope)
    change = np.einsum("ijn,jn->in", inverse_information(chi.information(point.effect)), pull)
    return np.where(np.isfinite(change).all(axis=0), change, 0.0)


def finite(distance: Array) -> Array:
    """Distances, infinite where they cannot be calculated."""
    return np.where(np.isfinite(distance), distance, np.inf)


def spread_of(information: Array) -> Array:
    """Standard uncertainties of degrees from their information, shape (faults, n)."""
    with np.errstate(invalid="ignore"):
        u: Array = np.sqrt(np.einsum("iin->in", inverse_information(information)))
    return np.where(np.isfinite(u), u, np.inf)


def distinguishable(information: Array) -> np.ndarray:
    """Whether the effects of simultaneous faults point in different directions, shape (n,)."""
    own = np.prod(np.einsum("iin->in", information), axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        apart: np.ndarray = (
            np.linalg.det(np.moveaxis(information, -1, 0)) > limits.DEGREES_APART * own
        )
    return apart
