"""Test one fault hypothesis by undoing it: which degree makes all estimates agree best?"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

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

Undone = Callable[[Array], tuple[Array, Array]]
"""Degree, shape (n,), to flows and their slopes by the degree, both (touched observers, n)."""


def covariance_of(gradients: Array, basis: Array) -> Array:
    """Covariance of the residual basis, shape (n, rank, rank)."""
    spread = np.einsum("ro,ovn->nrv", basis, gradients)
    covariance: Array = spread @ np.swapaxes(spread, 1, 2)
    return covariance


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


def _weighted(inverse: Array, a: Array, b: Array) -> Array:
    """Products of vectors in the metric of the inverse covariances, shape (n,)."""
    product: Array = np.einsum("nr,nrs,ns->n", a, inverse, b, optimize=True)
    return product


def distance_of(covariance: Array, residuals: Array) -> Array:
    """Chi-square of residuals, shape (n,)."""
    return _weighted(inverse_of(covariance), residuals, residuals)


@dataclass(frozen=True)
class Outcome:
    """Best degree per point with its standard uncertainty, chi-square left, log-likelihood."""

    degree: Array
    u: Array
    distance: Array
    evidence: Array


@dataclass(frozen=True)
class _State:
    """Where the search stands: shapes (n,), (n, rank), (n, rank), (n,)."""

    degree: Array
    effect: Array
    residuals: Array
    distance: Array

    def where(self, better: np.ndarray, other: _State) -> _State:
        """Take over the points where `other` is better."""
        wide = better[:, None]
        return _State(
            np.where(better, other.degree, self.degree),
            np.where(wide, other.effect, self.effect),
            np.where(wide, other.residuals, self.residuals),
            np.where(better, other.distance, self.distance),
        )


@dataclass(frozen=True)
class HypothesisTest:
    """Tests hypotheses on a group of points that share their usable observers."""

    ruleset: Ruleset
    observed: Observed
    valid: np.ndarray
    basis: Array
    members: np.ndarray
    covariance: Array

    def floor(self, fault: FaultSpec) -> Array:
        """Standard uncertainty of a small degree at each point; inf where it cannot show."""
        touched, places = self._touched(fault)
        if not touched:
            return np.full(len(self.members), np.inf)
        _, slopes = self._undone(fault, touched)(np.zeros(len(self.members)))
        effect = np.einsum("ro,on->nr", self.basis[:, places], slopes)
        size = np.sqrt(np.einsum("nr,nr->n", effect, effect))
        visible = size > NEGLIGIBLE * np.max(np.abs(slopes), axis=0)
        information = np.where(visible, distance_of(self.covariance, effect), 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            floor: Array = np.where(information > 0, 1.0 / np.sqrt(information), np.inf)
        return floor

    def _touched(self, fault: FaultSpec) -> tuple[list[str], list[int]]:
        """Usable observers that a fault makes wrong, and their places among the usable ones."""
        index = {o.id: i for i, o in enumerate(self.ruleset.observers)}
        column = np.cumsum(self.valid) - 1
        touched = [o for o in fault.affects if self.valid[index[o]]]
        return touched, [int(column[index[o]]) for o in touched]

    def run(self, fault: FaultSpec) -> Outcome | None:
        """Fit the degree of one fault; None where it touches no usable observer."""
        touched, places = self._touched(fault)
        if not touched:
            return None
        undone = self._undone(fault, touched)
        pure = self._fit(fault, undone, places, self.covariance, STARTS)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = 1.0 / np.sqrt(distance_of(self.covariance, pure.effect))
        # Degree and uncertainty are those of the pure law; only the question whether the law
        # fits at all is asked with its tolerance.
        widened = self._widened(fault, undone, pure.degree, places)
        best = self._fit(fault, undone, places, widened, (pure.degree,))
        _, volume = np.linalg.slogdet(np.where(np.isfinite(widened), widened, 0.0))
        usable = np.isfinite(volume) & np.isfinite(best.distance)
        evidence = np.full(len(volume), -np.inf)
        evidence[usable] = -0.5 * (best.distance[usable] + volume[usable])
        return Outcome(pure.degree, u, best.distance, evidence)

    def _undone(self, fault: FaultSpec, touched: list[str]) -> Undone:
        """Function of the degree: flows and slopes of the touched observers, fault undone."""
        names = [f"q:{o}" for o in touched] + [f"dq:{o}:{fault.id}" for o in touched]
        plan = self.ruleset.undo.select(names)
        needed = plan.used_inputs()
        inputs: dict[str, Array | float] = {
            name: values[self.members]
            for name, values in self.observed.points.values.items()
            if name in needed
        }
        inputs.update({f"x:{f.id}": 0.0 for f in self.ruleset.faults if f"x:{f.id}" in needed})
        shape = (len(self.members),)

        def evaluate(degree: Array) -> tuple[Array, Array]:
            out = plan.run({**inputs, f"x:{fault.id}": degree})
            values = [np.broadcast_to(out[name], shape) for name in names]
            return np.array(values[: len(touched)]), np.array(values[len(touched) :])

        return evaluate

    def _fit(
        self,
        fault: FaultSpec,
        undone: Undone,
        places: list[int],
        covariance: Array,
        starts: tuple[Array | float, ...],
    ) -> _State:
        """Degree of least distance: best start, then Gauss-Newton with halved steps."""
        n, top = len(self.members), fault.highest * (1.0 - 1e-6)
        inverse = inverse_of(covariance)
        flows = self.observed.flows[self.valid][:, self.members].copy()

        def state(degree: Array) -> _State:
            values, slopes = undone(degree)
            flows[places] = values
            residuals = np.einsum("ro,on->nr", self.basis, flows)
            effect = np.einsum("ro,on->nr", self.basis[:, places], slopes)
            distance = _weighted(inverse, residuals, residuals)
            return _State(
                degree, effect, residuals, np.where(np.isfinite(distance), distance, np.inf)
            )

        best = state(np.clip(starts[0] + np.zeros(n), fault.lowest, top))
        for start in starts[1:]:
            if fault.lowest < np.min(start) < top:
                other = state(start + np.zeros(n))
                best = best.where(other.distance < best.distance, other)
        share = np.ones(n)
        for _ in range(STEPS):
            with np.errstate(divide="ignore", invalid="ignore"):
                change = -_weighted(inverse, best.effect, best.residuals) / _weighted(
                    inverse, best.effect, best.effect
                )
            change = share * np.where(np.isfinite(change), change, 0.0)
            trial = state(np.clip(best.degree + change, fault.lowest, top))
            better = trial.distance < best.distance
            moved = np.abs(trial.degree - best.degree)
            best = best.where(better, trial)
            share = np.where(better, 1.0, 0.5 * share)
            if np.max(moved, initial=0.0) < CONVERGED:
                break
        return best

    def _widened(self, fault: FaultSpec, undone: Undone, degree: Array, places: list[int]) -> Array:
        """Covariance plus the tolerance of the fault: a real one never looks quite like its law.

        Each observer's own part of the effect may be off by the tolerance, independently.
        """
        measured, _ = undone(np.zeros(len(degree)))
        values, _ = undone(degree)
        spread = fault.tolerance * (values - measured)
        parts = np.einsum("ro,on->nro", self.basis[:, places], spread)
        widened: Array = self.covariance + parts @ np.swapaxes(parts, 1, 2)
        return widened
