"""Test a hypothesis by undoing its faults: which degrees make all estimates agree best?"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from runtime.observe import Observed
from runtime.plan import Array
from runtime.ruleset import FaultSpec, Ruleset

NEGLIGIBLE = 1e-6
"""Share of a fault's own effect below which residuals count as untouched (it cancels)."""

STEPS = 15
"""Gauss-Newton steps at most; a step that leads away is halved, and counts."""

CONVERGED = 1e-9
"""Change of a degree below which it stands."""

STARTS = (0.0, 0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.97, 1.5, 2.5, 5.0, 10.0)
"""Degrees tried first. Far from its start Gauss-Newton may run into a pole of the law."""

FACTOR = 10.0
"""Errors of an estimate are scaled by this at most: near the pole of a law all is lost anyway."""

APART = 1e-4
"""Determinant of the information over its diagonal below which degrees are not told apart."""

Faults = tuple[FaultSpec, ...]
"""The faults of one hypothesis, at the same time."""

Undone = Callable[[Array], tuple[Array, Array]]
"""Degrees, shape (n, faults), to flows (touched observers, n) and their slopes by each degree
(touched observers, faults, n)."""


def inverse_of(covariance: Array) -> Array:
    """Inverse of each covariance, shape (n, rank, rank).

    A trace of ridge keeps residuals without any uncertainty of their own solvable; points whose
    covariance is not finite give NaN.
    """
    rank = covariance.shape[1]
    size = np.einsum("nrr->n", covariance)
    sound = np.isfinite(covariance).all(axis=(1, 2)) & (size > 0)
    regular = np.where(sound[:, None, None], covariance, np.eye(rank))
    regular = regular + (1e-12 * np.where(sound, size, 1.0))[:, None, None] * np.eye(rank)
    inverse: Array = np.asarray(np.linalg.inv(regular), dtype=float)
    inverse[~sound] = np.nan
    return inverse


def products(inverse: Array, a: Array, b: Array) -> Array:
    """Products of vectors in the metric of the inverse covariances, shape (n,)."""
    product: Array = np.einsum("nr,nrs,ns->n", a, inverse, b, optimize=True)
    return product


@dataclass(frozen=True)
class Outcome:
    """Per problem: best degrees and their standard uncertainties, shape (n, faults), chi-square
    left, log-likelihood, both shape (n,)."""

    degree: Array
    u: Array
    distance: Array
    evidence: Array


@dataclass(frozen=True)
class _State:
    """Where the search stands: shapes (n, faults), (n, rank, faults), (n, rank), (n,)."""

    degree: Array
    effect: Array
    residuals: Array
    distance: Array

    def where(self, better: np.ndarray, other: _State) -> _State:
        """Take over the points where `other` is better."""
        wide = better[:, None]
        return _State(
            np.where(wide, other.degree, self.degree),
            np.where(wide[:, None], other.effect, self.effect),
            np.where(wide, other.residuals, self.residuals),
            np.where(better, other.distance, self.distance),
        )


@dataclass(frozen=True)
class HypothesisTest:
    """Tests hypotheses on points that share their usable observers.

    Each point is a problem of its own. If `present` is given, shape (points,), all points together
    are one problem with the same degrees wherever the faults are present (1) and none elsewhere
    (0). `spread` gives the covariance of each problem, shape (problems, rank, rank), for factors
    by which the errors of each usable observer are scaled, shape (observers, points).
    """

    ruleset: Ruleset
    observed: Observed
    valid: np.ndarray
    basis: Array
    members: np.ndarray
    spread: Callable[[Array], Array]
    present: Array | None = None

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the residuals as measured, shape (problems, rank, rank)."""
        return self.spread(np.ones((int(self.valid.sum()), len(self.members))))

    def residuals(self) -> Array:
        """Residuals as measured, shape (problems, rank)."""
        return self._residuals_of(self._flows())

    def effect(self, fault: FaultSpec) -> Array | None:
        """Slope of the residuals by a small degree, shape (problems, rank); 0 where it cancels."""
        touched, places = self._touched((fault,))
        if not touched:
            return None
        _, slopes = self._undone((fault,), touched)(np.zeros((len(self.members), 1)))
        effect = self._effects_of(slopes, places)[..., 0]
        size = np.sqrt(np.einsum("nr,nr->n", effect, effect))
        own = np.max(np.abs(slopes), axis=(0, 1))
        visible = size > NEGLIGIBLE * (own if self.present is None else np.max(own, keepdims=True))
        return np.where(visible[:, None], effect, 0.0)

    def run(self, faults: Faults, starts: Iterable[Array] | None = None) -> Outcome | None:
        """Fit the degrees of a hypothesis; None where it touches no usable observer.

        `starts` are degrees to begin with, each of a shape that broadcasts to (n, faults).
        """
        touched, places = self._touched(faults)
        if not touched:
            return None
        undone = self._undone(faults, touched)
        begin = [np.array([s]) for s in STARTS] if starts is None else list(starts)
        rough = self._fit(faults, undone, places, self.covariance, begin)
        # What a fault takes away or adds, it takes from the errors of an estimate as well.
        covariance = self.spread(self._scale(faults, undone, places, rough.degree))
        pure = self._fit(faults, undone, places, covariance, (rough.degree,))
        information = _information(inverse_of(covariance), pure.effect)
        u = _spread(information)
        # Degree and uncertainty are those of the pure law; only the question whether the law
        # fits at all is asked with its tolerance.
        widened = self._widened(faults, undone, pure.degree, places, covariance)
        best = self._fit(faults, undone, places, widened, (pure.degree,))
        usable = np.isfinite(best.distance) & np.isfinite(u).all(axis=1)
        if len(faults) > 1:
            usable &= _told_apart(information)
        # The tolerance must not speak against a fault either: no price for the wider covariance.
        evidence = np.where(usable, -0.5 * best.distance, -np.inf)
        distance = np.where(usable, best.distance, np.inf) if len(faults) > 1 else best.distance
        return Outcome(pure.degree, u, distance, evidence)

    def _flows(self) -> Array:
        """Usable flows less what the baseline takes, shape (usable observers, n)."""
        seen = self.observed
        flows: Array = (seen.flows[self.valid] - seen.offsets[self.valid])[:, self.members]
        return flows

    def _residuals_of(self, flows: Array) -> Array:
        residuals: Array = np.einsum("ro,on->nr", self.basis, flows)
        return residuals if self.present is None else residuals.reshape(1, -1)

    def _effects_of(self, slopes: Array, places: Sequence[int]) -> Array:
        effect: Array = np.einsum("ro,odn->nrd", self.basis[:, places], slopes)
        if self.present is None:
            return effect
        return (effect * self.present[:, None, None]).reshape(1, -1, effect.shape[2])

    def _everywhere(self, degree: Array) -> Array:
        """Degrees of the problems, shape (problems, faults), as degrees at all points."""
        return degree if self.present is None else degree * self.present[:, None]

    def _touched(self, faults: Faults) -> tuple[list[str], list[int]]:
        """Usable observers that the faults make wrong, and their places among the usable ones."""
        index = self.ruleset.observer_index
        column = np.cumsum(self.valid) - 1
        affected = dict.fromkeys(o for f in faults for o in f.affects)
        touched = [o for o in affected if self.valid[index[o]]]
        return touched, [int(column[index[o]]) for o in touched]

    def _undone(self, faults: Faults, touched: list[str]) -> Undone:
        """Function of the degrees: flows and slopes of the touched observers, faults undone."""
        plan = self.ruleset.undone(tuple(touched), tuple(f.id for f in faults))
        names = [f"q:{o}" for o in touched]
        slopes = [[f"dq:{o}:{f.id}" for f in faults] for o in touched]
        needed = plan.used_inputs()
        inputs: dict[str, Array | float] = {
            name: values[self.members]
            for name, values in self.observed.points.values.items()
            if name in needed
        }
        inputs.update({f"x:{f.id}": 0.0 for f in self.ruleset.faults if f"x:{f.id}" in needed})
        shape = (len(self.members),)
        index = self.ruleset.observer_index
        offsets = self.observed.offsets[[index[o] for o in touched]][:, self.members]
        none = np.zeros(shape)
        measured = self.observed.flows[[index[o] for o in touched]][:, self.members]
        in_sensor = any(f.in_sensor for f in faults)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(measured != 0, offsets / measured, 0.0)

        def evaluate(degree: Array) -> tuple[Array, Array]:
            out = plan.run({**inputs, **{f"x:{f.id}": degree[:, i] for i, f in enumerate(faults)}})
            values = np.array([np.broadcast_to(out[name], shape) for name in names])
            gradient = [[np.broadcast_to(out.get(s, none), shape) for s in row] for row in slopes]
            if in_sensor:
                return values - offsets, np.array(gradient)
            # What the baseline takes from an estimate scales with it, its slope too.
            return values * (1.0 - share), np.array(gradient) * (1.0 - share)[:, None]

        return evaluate

    def _state(
        self, undone: Undone, places: Sequence[int], inverse: Array, degree: Array
    ) -> _State:
        """Residuals and distance with the faults undone at degrees, shape (problems, faults)."""
        values, slopes = undone(self._everywhere(degree))
        flows = self._flows()
        flows[places] = values
        residuals = self._residuals_of(flows)
        distance = products(inverse, residuals, residuals)
        finite = np.where(np.isfinite(distance), distance, np.inf)
        return _State(degree, self._effects_of(slopes, places), residuals, finite)

    def _fit(
        self,
        faults: Faults,
        undone: Undone,
        places: Sequence[int],
        covariance: Array,
        starts: Iterable[Array],
    ) -> _State:
        """Degrees of least distance: best start, then Gauss-Newton with halved steps."""
        low = np.array([f.lowest for f in faults])
        top = np.array([f.highest for f in faults]) * (1.0 - 1e-6)
        inverse = inverse_of(covariance)
        blank = np.zeros((len(covariance), len(faults)))
        best: _State | None = None
        for start in starts:
            if best is not None and start.size == 1 and not low.min() < start.min() < top.max():
                continue
            here = self._state(undone, places, inverse, np.clip(start + blank, low, top))
            best = here if best is None else best.where(here.distance < best.distance, here)
        assert best is not None
        share = np.ones(len(covariance))
        for _ in range(STEPS):
            change = share[:, None] * _newton_step(inverse, best.effect, best.residuals)
            trial = self._state(undone, places, inverse, np.clip(best.degree + change, low, top))
            better = trial.distance < best.distance
            moved = np.max(np.abs(trial.degree - best.degree), initial=0.0)
            best = best.where(better, trial)
            share = np.where(better, 1.0, 0.5 * share)
            if moved < CONVERGED:
                break
        return best

    def _scale(self, faults: Faults, undone: Undone, places: Sequence[int], degree: Array) -> Array:
        """Undone over measured flow of each usable observer, shape (observers, points).

        So the errors of an estimate scale where a law acts as a factor, and nearly so elsewhere.
        A reading that a fault scales takes its errors along: undone, they are as before.
        """
        flows = self._flows()
        scale = np.ones_like(flows)
        outside = degree * np.array([0.0 if f.in_sensor else 1.0 for f in faults])
        with np.errstate(divide="ignore", invalid="ignore"):
            scale[places] = undone(self._everywhere(outside))[0] / flows[places]
        return np.where(np.isfinite(scale), np.clip(scale, -FACTOR, FACTOR), 1.0)

    def _widened(
        self,
        faults: Faults,
        undone: Undone,
        degree: Array,
        places: Sequence[int],
        covariance: Array,
    ) -> Array:
        """Covariance plus the tolerance of each fault: a real one never looks quite like its law.

        Each observer's own part of an effect may be off by the tolerance, independently of the
        other observers, but alike at all points of one problem.
        """
        everywhere = self._everywhere(degree)
        values, _ = undone(everywhere)
        widened = covariance
        for i, fault in enumerate(faults):
            without = everywhere.copy()
            without[:, i] = 0.0
            spread = fault.tolerance * (values - undone(without)[0])
            parts = np.einsum("ro,on->nro", self.basis[:, places], spread)
            if self.present is not None:
                parts = parts.reshape(1, -1, parts.shape[2])
            widened = widened + parts @ np.swapaxes(parts, 1, 2)
        return widened


def _information(inverse: Array, effect: Array) -> Array:
    """Information on the degrees of each problem, shape (n, faults, faults)."""
    information: Array = np.swapaxes(effect, 1, 2) @ (inverse @ effect)
    return information


def _newton_step(inverse: Array, effect: Array, residuals: Array) -> Array:
    """Gauss-Newton change of the degrees, shape (n, faults); 0 where there is none."""
    weighted = np.swapaxes(effect, 1, 2) @ inverse
    information, pull = weighted @ effect, (weighted @ residuals[:, :, None])[:, :, 0]
    if effect.shape[2] == 1:
        with np.errstate(divide="ignore", invalid="ignore"):
            change = -pull / information[:, :, 0]
    else:
        change = -np.einsum("nij,nj->ni", _inverted(information), pull)
    return np.where(np.isfinite(change).all(axis=1, keepdims=True), change, 0.0)


def _inverted(information: Array) -> Array:
    """Inverse of small information matrices; NaN where they have none."""
    size = np.einsum("nii->n", information)
    sound = np.isfinite(information).all(axis=(1, 2)) & (size > 0)
    count = information.shape[1]
    regular = np.where(sound[:, None, None], information, np.eye(count))
    regular = regular + (1e-14 * np.where(sound, size, 1.0))[:, None, None] * np.eye(count)
    inverse: Array = np.linalg.inv(regular)
    inverse[~sound] = np.nan
    return inverse


def _spread(information: Array) -> Array:
    """Standard uncertainties of degrees from their information, shape (n, faults)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        if information.shape[1] == 1:
            u: Array = 1.0 / np.sqrt(information[:, :, 0])
        else:
            u = np.sqrt(np.einsum("nii->ni", _inverted(information)))
    return np.where(np.isfinite(u), u, np.inf)


def _told_apart(information: Array) -> np.ndarray:
    """Whether the effects of simultaneous faults point in different directions, shape (n,)."""
    own = np.prod(np.einsum("nii->ni", information), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        apart: np.ndarray = np.linalg.det(information) > APART * own
    return apart
