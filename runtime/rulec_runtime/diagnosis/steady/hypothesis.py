"""Test a hypothesis by undoing its faults: which degrees make all estimates agree best?"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.diagnosis.steady.chi_square import (
    ChiSquare,
    chi_square,
    inverse_information,
    inverse_of,
)
from rulec_runtime.diagnosis.steady.fault_inversion import Faults, Undoing
from rulec_runtime.diagnosis.steady.observe import Observed


@dataclass(frozen=True)
class Outcome:
    """Per problem: best degrees and their standard uncertainties, shape (n, faults), chi-square
    left, log-likelihood, both shape (n,)."""

    degree: Array
    u: Array
    distance: Array
    evidence: Array


@dataclass(frozen=True)
class Scales:
    """Factors on the errors of each usable flow, shape (flows, points), where faults are undone:
    on what is new at every point, and on what lasts."""

    noise: Array
    lasting: Array


@dataclass(frozen=True)
class FirstOrder:
    """What a small degree of a fault does: touched flows (places) and their slopes by the degree,
    shape (touched, n), 0 where the residuals do not see it."""

    flows: list[int]
    slope: Array


@dataclass(frozen=True)
class _State:
    """Where the search stands, n problems last.

    Degrees (faults, n), how far they move flows and half the slope of chi-square there, both
    (flows, n), effect of the degrees on the flows (flows, faults, n), chi-square (n,).
    """

    degree: Array
    moved: Array
    slope: Array
    effect: Array
    distance: Array

    def judged_by(self, chi: ChiSquare) -> _State:
        """The same place with another chi-square."""
        distance, slope = chi.at(self.moved)
        return replace(self, slope=slope, distance=_finite(distance))

    def is_better(self, other: _State) -> np.ndarray:
        """Whether chi-square is less than at another state, shape (n,).

        The difference of a quadratic between two places is exact in the slopes; a difference of
        values would lose the last steps of the search in rounding.
        """
        gain = np.einsum("in,in->n", self.moved - other.moved, self.slope + other.slope)
        better: np.ndarray = np.isfinite(self.distance) & (gain < 0)
        return better

    def where(self, better: np.ndarray, other: _State) -> _State:
        """Take over the problems where `other` is better."""
        return _State(
            np.where(better, other.degree, self.degree),
            np.where(better, other.moved, self.moved),
            np.where(better, other.slope, self.slope),
            np.where(better, other.effect, self.effect),
            np.where(better, other.distance, self.distance),
        )


@dataclass(frozen=True, kw_only=True)
class HypothesisTest:
    """Tests hypotheses on points that share their usable observers.

    Each point is a problem of its own. If `present` is given, shape (points,), all points together
    are one problem with the same degrees wherever the faults are present (1) and none elsewhere
    (0). `spread` gives the covariance of each problem, shape (problems, rank, rank), as measured
    or with the errors of each usable flow scaled.
    """

    ruleset: Ruleset
    observed: Observed
    valid: np.ndarray
    basis: Array
    members: np.ndarray
    spread: Callable[[Scales | None], Array]
    present: Array | None = None

    def residuals(self) -> Array:
        """Residuals as measured, shape (problems, rank)."""
        residuals: Array = (self.basis @ (self._flows - self._offsets)).T
        return residuals if self.present is None else residuals.reshape(1, -1)

    @cached_property
    def chi_square(self) -> ChiSquare:
        """Chi-square as a function of the usable flows; those of one point after the other where
        all points are one problem."""
        return self._chi_square(None)

    def first_order(self, fault: FaultSpec) -> FirstOrder | None:
        """Effect of a small degree; None where the fault touches no usable observer."""
        undoing, flows = self._undoing((fault,))
        if not flows:
            return None
        _, slopes = undoing.moved_and_slopes(np.zeros((1, len(self.members))))
        slope = self._effect(slopes)[:, 0]
        size = np.sqrt(np.sum((self._lifted[:, flows] @ slope) ** 2, axis=0))
        own = np.max(np.abs(slopes), axis=(0, 1))
        visible = size > limits.UNTOUCHED * (
            own if self.present is None else np.max(own, keepdims=True)
        )
        return FirstOrder(flows, np.where(visible, slope, 0.0))

    def towards(self, fault: FaultSpec) -> tuple[Array, Array] | None:
        """How much a small degree lowers half of chi-square per degree, and the information on the
        degree, both shape (n,); None where the fault touches no usable observer."""
        first = self.first_order(fault)
        if first is None:
            return None
        chi = self.chi_square.of(first.flows)
        information: Array = chi.information(first.slope[:, None])[0, 0]
        pull: Array = -np.einsum("in,in->n", first.slope, chi.slope)
        return pull, information

    def run(self, faults: Faults, starts: Iterable[Array] | None = None) -> Outcome | None:
        """Fit the degrees of a hypothesis; None where it touches no usable observer.

        `starts` are degrees to begin with, each of a shape that broadcasts to (n, faults).
        """
        undoing, flows = self._undoing(faults)
        if not flows:
            return None
        pure = self.chi_square.of(flows)
        begin = _single(faults) if starts is None else np.array([s[0] for s in starts]).T
        start = self._best_start(undoing, pure, begin)
        best = self._fit(undoing, pure, self._state(undoing, pure, start))
        # What a fault takes from a flow or adds to it, it takes from its errors as well.
        pure = self._chi_square(self._scales(undoing, best.degree)).of(flows)
        best = self._fit(undoing, pure, best.judged_by(pure))
        # Degree and uncertainty are those of the pure law; only the question whether the law
        # fits at all is asked with its tolerance.
        widened = pure.tolerating(self._tolerance(undoing, best.degree))
        left = self._fit(undoing, widened, best.judged_by(widened)).distance
        information = pure.information(best.effect)
        u = _spread(information)
        usable = np.isfinite(left) & np.isfinite(u).all(axis=0)
        if len(faults) > 1:
            usable &= _told_apart(information)
        # The tolerance must not speak against a fault either: no price for the wider covariance.
        evidence = np.where(usable, -0.5 * left, -np.inf)
        distance = np.where(usable, left, np.inf) if len(faults) > 1 else left
        return Outcome(best.degree.T, u.T, distance, evidence)

    def _chi_square(self, scale: Scales | None) -> ChiSquare:
        return chi_square(inverse_of(self.spread(scale)), self.residuals(), self._lifted)

    def _scales(self, undoing: Undoing, degree: Array) -> Scales:
        """Factors by which undoing the faults scales the errors of each usable flow.

        Noise is that of the readings as they are: undoing scales it. A systematic error is that of
        a sound sensor: a reading that a fault scales takes it along, and undone it is as before.
        """
        outside = np.array([[0.0 if f.in_sensor else 1.0] for f in undoing.faults])
        return Scales(self._scale(undoing, degree), self._scale(undoing, degree * outside))

    def _scale(self, undoing: Undoing, degree: Array) -> Array:
        """Undone over measured flow of each usable observer, shape (usable, points).

        So the errors of an estimate scale where a law acts as a factor, and nearly so elsewhere.
        """
        column = np.cumsum(self.valid) - 1
        places = [int(column[self.ruleset.observer_index[o]]) for o in undoing.touched]
        scale = np.ones_like(self._flows)
        with np.errstate(divide="ignore", invalid="ignore"):
            moved = undoing.moved(self._everywhere(degree))
            scale[places] += moved / self._flows[places]
        return np.where(
            np.isfinite(scale), np.clip(scale, -limits.LARGEST_SCALE, limits.LARGEST_SCALE), 1.0
        )

    @cached_property
    def _flows(self) -> Array:
        """Usable flows, shape (usable observers, points)."""
        flows: Array = self.observed.flows[self.valid][:, self.members]
        return flows

    @cached_property
    def _offsets(self) -> Array:
        """What the baseline takes from them."""
        offsets: Array = self.observed.offsets[self.valid][:, self.members]
        return offsets

    @cached_property
    def _readings(self) -> dict[str, Array]:
        """Readings per signal, shape (points,)."""
        values = self.observed.points.values
        return {name: readings[self.members] for name, readings in values.items()}

    @cached_property
    def _lifted(self) -> Array:
        """Slopes of the residuals of a problem by its flows, shape (rank, flows)."""
        if self.present is None:
            return self.basis
        return np.asarray(np.kron(np.eye(len(self.present)), self.basis), dtype=float)

    def _as_problems(self, table: Array) -> Array:
        """A table of touched flows, shape (touched, ..., points), as (flows, ..., problems)."""
        if self.present is None:
            return table
        return np.moveaxis(table, -1, 0).reshape(-1, *table.shape[1:-1], 1)

    def _effect(self, slopes: Array) -> Array:
        """Slopes at the points as those of the problems, shape (flows, faults, problems)."""
        return self._as_problems(slopes if self.present is None else slopes * self.present)

    def _everywhere(self, degree: Array) -> Array:
        """Degrees of the problems, shape (faults, ..., problems), as degrees at all points."""
        return degree if self.present is None else degree * self.present

    def _undoing(self, faults: Faults) -> tuple[Undoing, list[int]]:
        """The faults in the usable observers that they touch, and the places of these flows."""
        index = self.ruleset.observer_index
        column = np.cumsum(self.valid) - 1
        affected = dict.fromkeys(o for f in faults for o in f.affects)
        touched = [o for o in affected if self.valid[index[o]]]
        places = [int(column[index[o]]) for o in touched]
        kept = np.ones_like(self._flows[places])
        if not any(f.in_sensor for f in faults):
            with np.errstate(divide="ignore", invalid="ignore"):
                share = self._offsets[places] / self._flows[places]
            kept -= np.where(np.isfinite(share), share, 0.0)
        measured = self._flows[places]
        undoing = Undoing(
            ruleset=self.ruleset,
            faults=faults,
            touched=touched,
            readings=self._readings,
            measured=measured,
            kept=kept,
        )
        if self.present is None:
            return undoing, places
        usable, points = len(self._flows), len(self.present)
        return undoing, [point * usable + place for point in range(points) for place in places]

    def _best_start(self, undoing: Undoing, chi: ChiSquare, starts: Array) -> Array:
        """The best of some degrees, shape (faults, starts), for each problem: (faults, n)."""
        low, top = _range(undoing.faults)
        degree = np.clip(starts, low, top)[:, :, None] + np.zeros(len(chi.value))
        distance, _ = chi.at(self._as_problems(undoing.moved(self._everywhere(degree))))
        best = np.argmin(_finite(distance), axis=0)
        chosen: Array = np.take_along_axis(degree, best[None, None], axis=1)[:, 0]
        return chosen

    def _state(self, undoing: Undoing, chi: ChiSquare, degree: Array) -> _State:
        """Chi-square with the faults undone at degrees, shape (faults, problems)."""
        moved, slopes = undoing.moved_and_slopes(self._everywhere(degree))
        moved = self._as_problems(moved)
        distance, slope = chi.at(moved)
        return _State(degree, moved, slope, self._effect(slopes), _finite(distance))

    def _fit(self, undoing: Undoing, chi: ChiSquare, best: _State) -> _State:
        """Degrees of least distance: Gauss-Newton with halved steps."""
        low, top = _range(undoing.faults)
        share = np.ones(best.degree.shape[1])
        for _ in range(limits.FIT_STEPS):
            change = share * _newton_step(chi, best)
            trial = self._state(undoing, chi, np.clip(best.degree + change, low, top))
            better = trial.is_better(best)
            moved = np.max(np.abs(trial.degree - best.degree), initial=0.0)
            best = best.where(better, trial)
            share = np.where(better, 1.0, 0.5 * share)
            if moved < limits.FIT_CONVERGED:
                break
        return best

    def _tolerance(self, undoing: Undoing, degree: Array) -> Array:
        """Covariance of the touched flows by the tolerance of each fault, shape (flows, flows, n):
        a real one never looks quite like its law.

        Each observer's own part of an effect may be off by the tolerance, independently of the
        other observers, but alike at all points of one problem.
        """
        count = len(undoing.faults)
        # As found, then without each of the faults.
        tried = np.repeat(self._everywhere(degree)[:, None], count + 1, axis=1)
        tried[range(count), range(1, count + 1)] = 0.0
        moved = undoing.moved(tried)
        covariance: Array | float = 0.0
        for i, fault in enumerate(undoing.faults):
            spread = fault.tolerance * (moved[:, 0] - moved[:, i + 1])
            parts = self._as_problems(spread[:, None] * np.eye(len(spread))[:, :, None])
            covariance = covariance + np.einsum("ikn,jkn->ijn", parts, parts)
        return np.asarray(covariance)


def _range(faults: Faults) -> tuple[Array, Array]:
    """Lowest and highest degree of each fault, shape (faults, 1)."""
    inside = 1.0 - limits.BELOW_HIGHEST
    return np.array([[f.lowest] for f in faults]), np.array([[f.highest * inside] for f in faults])


def _single(faults: Faults) -> Array:
    """Degrees tried first where none are given, shape (faults, starts): zero and what is in the
    range of the faults."""
    low, top = _range(faults)
    scale = np.array([[f.scale] for f in faults])
    low, top = low / scale, top / scale
    starts = np.array(limits.FIT_STARTS)
    tried = starts[(starts == 0.0) | ((low.min() < starts) & (top.max() > starts))]
    result: Array = tried * scale
    return result


def pair_starts() -> list[Array]:
    """Degrees of two faults tried first, each of shape (1, 2)."""
    return [np.array([[a, b]]) for a in limits.PAIR_STARTS for b in limits.PAIR_STARTS]


def _finite(distance: Array) -> Array:
    """Nothing is farther than what cannot be calculated."""
    return np.where(np.isfinite(distance), distance, np.inf)


def _newton_step(chi: ChiSquare, state: _State) -> Array:
    """Gauss-Newton change of the degrees, shape (faults, n); 0 where there is none."""
    pull = -np.einsum("idn,in->dn", state.effect, state.slope)
    change = np.einsum("ijn,jn->in", inverse_information(chi.information(state.effect)), pull)
    return np.where(np.isfinite(change).all(axis=0), change, 0.0)


def _spread(information: Array) -> Array:
    """Standard uncertainties of degrees from their information, shape (faults, n)."""
    with np.errstate(invalid="ignore"):
        u: Array = np.sqrt(np.einsum("iin->in", inverse_information(information)))
    return np.where(np.isfinite(u), u, np.inf)


def _told_apart(information: Array) -> np.ndarray:
    """Whether the effects of simultaneous faults point in different directions, shape (n,)."""
    own = np.prod(np.einsum("iin->in", information), axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        apart: np.ndarray = (
            np.linalg.det(np.moveaxis(information, -1, 0)) > limits.DEGREES_APART * own
        )
    return apart
