"""Which fault fits: every hypothesis against the whole residual vector, degree free.

A hypothesis is tested by undoing it. With the right degree of the right fault put into the
observers, all estimates of a flow agree within their uncertainty. The degree is found by
generalised least squares (a few Gauss-Newton steps), in the metric of the residuals' covariance,
so a residual that a fault leaves at zero counts as much as one that it moves.

Source: own derivation, see docs/method.md; generalised least squares as in any textbook.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from runtime.observe import Observed
from runtime.plan import Array
from runtime.ruleset import FaultSpec, Ruleset

ALARM = 4.0
"""Normal quantile of the test that something is wrong at all (3e-5 a point)."""

ACCEPT = 3.0
"""Normal quantile up to which a hypothesis counts as fitting (1e-3)."""

NEGLIGIBLE = 1e-6
"""Share of a fault's own effect below which residuals count as untouched (it cancels)."""

STEPS = 8
"""Gauss-Newton steps; the linear rule is the first."""


Undone = Callable[[Array], tuple[Array, Array]]
"""Degree, shape (n,), to flows and their slopes by the degree, both (touched observers, n)."""


@dataclass(frozen=True)
class Isolation:
    """Result per point, n of them, and fault.

    Attributes
    ----------
    judged, deviating : shape (n,); deviating points are not explained by noise.
    misfit : shape (n,), chi-square of "no fault", with `freedom` degrees of freedom.
    degree, u : shape (faults, n).
    floor : shape (faults, n), standard uncertainty of a degree near 0; inf where the usable
        estimates cannot show the fault.
    distance : shape (faults, n), chi-square left when the fault is undone; inf if untestable.
    probability : shape (faults, n), among the faults that fit; 0 for the others.
    """

    judged: np.ndarray
    deviating: np.ndarray
    misfit: Array
    freedom: np.ndarray
    degree: Array
    u: Array
    floor: Array
    distance: Array
    probability: Array


def chi_square_limit(freedom: int, quantile: float) -> float:
    """Quantile of chi-square for a normal quantile (Wilson and Hilferty 1931)."""
    part = 2.0 / (9.0 * freedom)
    return float(freedom * (1.0 - part + quantile * np.sqrt(part)) ** 3)


def residual_basis(ruleset: Ruleset, valid: np.ndarray) -> Array:
    """Independent combinations of valid observers that vanish in a healthy plant.

    The flows of all modules obey the junction balances; what the observers say beyond one value
    per free flow is redundant. Shape (rank, valid observers), orthonormal rows.
    """
    modules = {name: i for i, name in enumerate(ruleset.modules)}
    balances = np.zeros((len(ruleset.junctions), len(modules)))
    for row, junction in zip(balances, ruleset.junctions, strict=True):
        for name in junction.outlets:
            row[modules[name]] += 1.0
        for name in junction.inlets:
            row[modules[name]] -= 1.0
    free_flows = _null_space(balances)
    chosen = [modules[o.module] for o, ok in zip(ruleset.observers, valid, strict=True) if ok]
    return _null_space(free_flows[chosen].T).T


def _null_space(matrix: Array) -> Array:
    """Orthonormal basis of the null space, shape (columns, dimension)."""
    if not matrix.size:
        return np.eye(matrix.shape[1])
    _, sizes, rows = np.linalg.svd(matrix)
    rank = int(np.sum(sizes > 1e-10 * max(sizes.max(initial=0.0), 1.0)))
    return rows[rank:].T


def isolate(ruleset: Ruleset, observed: Observed) -> Isolation:
    """Judge every point; points with the same usable observers are judged together."""
    n, faults = len(observed), ruleset.faults
    result = Isolation(
        np.zeros(n, dtype=bool),
        np.zeros(n, dtype=bool),
        np.zeros(n),
        np.zeros(n, dtype=int),
        np.zeros((len(faults), n)),
        np.full((len(faults), n), np.inf),
        np.full((len(faults), n), np.inf),
        np.full((len(faults), n), np.inf),
        np.zeros((len(faults), n)),
    )
    patterns, group = np.unique(observed.valid, axis=1, return_inverse=True)
    for i in range(patterns.shape[1]):
        members = np.flatnonzero(np.ravel(group) == i)
        basis = residual_basis(ruleset, patterns[:, i])
        if len(basis):
            _judge_group(ruleset, observed, patterns[:, i], basis, members, result)
    return result


def _judge_group(
    ruleset: Ruleset,
    observed: Observed,
    valid: np.ndarray,
    basis: Array,
    members: np.ndarray,
    result: Isolation,
) -> None:
    flows = observed.flows[valid][:, members]
    covariance = _covariance(observed.gradients[valid][:, :, members], basis)
    residuals = np.einsum("ro,on->nr", basis, flows)
    misfit = _distance(covariance, residuals)
    result.judged[members] = True
    result.misfit[members] = misfit
    result.freedom[members] = len(basis)
    deviating = misfit > chi_square_limit(len(basis), ALARM)
    result.deviating[members] = deviating
    every = _Test(ruleset, observed, valid, basis, members, covariance)
    for i, fault in enumerate(ruleset.faults):
        result.floor[i, members] = every.floor(fault)
    if not deviating.any():
        return
    chosen = members[deviating]
    test = _Test(ruleset, observed, valid, basis, chosen, covariance[deviating])
    evidence = np.full((len(ruleset.faults), len(chosen)), -np.inf)
    for i, fault in enumerate(ruleset.faults):
        outcome = test.run(fault)
        if outcome is None:
            continue
        result.degree[i, chosen], result.u[i, chosen] = outcome.degree, outcome.u
        result.distance[i, chosen], evidence[i] = outcome.distance, outcome.evidence
    fits = result.distance[:, chosen] <= _accepted(len(basis))
    evidence[~fits] = -np.inf
    best = np.max(evidence, axis=0, initial=-np.inf)
    weight = np.where(fits, np.exp(evidence - np.where(np.isfinite(best), best, 0.0)), 0.0)
    total = weight.sum(axis=0)
    result.probability[:, chosen] = weight / np.where(total > 0, total, 1.0)


def _accepted(rank: int) -> float:
    """Limit of the distance with one degree fitted; with one residual alone anything fits."""
    return chi_square_limit(rank - 1, ACCEPT) if rank > 1 else ACCEPT**2


def _covariance(gradients: Array, basis: Array) -> Array:
    """Covariance of the residual basis, shape (n, rank, rank)."""
    spread = np.einsum("ro,ovn->nrv", basis, gradients)
    covariance: Array = spread @ np.swapaxes(spread, 1, 2)
    return covariance


def _solve(covariance: Array, vectors: Array) -> Array:
    """Apply the inverse of each covariance, shape (n, rank, rank), to its vector (n, rank).

    A trace of ridge keeps residuals without any uncertainty of their own solvable; points whose
    covariance is not finite give NaN.
    """
    rank = covariance.shape[1]
    size = np.einsum("nrr->n", covariance)
    sound = np.isfinite(covariance).all(axis=(1, 2)) & (size > 0)
    regular = np.where(sound[:, None, None], covariance, np.eye(rank))
    regular = regular + (1e-12 * np.where(sound, size, 1.0))[:, None, None] * np.eye(rank)
    solved: Array = np.asarray(np.linalg.solve(regular, vectors[..., None])[..., 0], dtype=float)
    solved[~sound] = np.nan
    return solved


def _distance(covariance: Array, residuals: Array) -> Array:
    """Chi-square of residuals, shape (n,)."""
    distance: Array = np.einsum("nr,nr->n", residuals, _solve(covariance, residuals))
    return distance


@dataclass(frozen=True)
class _Outcome:
    degree: Array
    u: Array
    distance: Array
    evidence: Array


@dataclass(frozen=True)
class _Test:
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
        information = np.where(visible, _distance(self.covariance, effect), 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            floor: Array = np.where(information > 0, 1.0 / np.sqrt(information), np.inf)
        return floor

    def _touched(self, fault: FaultSpec) -> tuple[list[str], list[int]]:
        """Usable observers that a fault makes wrong, and their places among the usable ones."""
        index = {o.id: i for i, o in enumerate(self.ruleset.observers)}
        column = np.cumsum(self.valid) - 1
        touched = [o for o in fault.affects if self.valid[index[o]]]
        return touched, [int(column[index[o]]) for o in touched]

    def run(self, fault: FaultSpec) -> _Outcome | None:
        """Fit the degree of one fault; None where it touches no usable observer."""
        touched, places = self._touched(fault)
        if not touched:
            return None
        undone = self._undone(fault, touched)
        degree, effect, _ = self._fit(fault, undone, places, self.covariance)
        with np.errstate(divide="ignore"):
            u = 1.0 / np.sqrt(_distance(self.covariance, effect))
        # Degree and uncertainty are those of the pure law; only the question whether the law
        # fits at all is asked with its tolerance.
        widened = self._widened(fault, undone, degree, places)
        _, _, residuals = self._fit(fault, undone, places, widened, degree)
        distance = _distance(widened, residuals)
        distance = np.where(np.isfinite(distance), distance, np.inf)
        finite = np.where(np.isfinite(widened), widened, 0.0)
        _, volume = np.linalg.slogdet(finite)
        evidence = np.where(np.isfinite(volume), -0.5 * (distance + volume), -np.inf)
        return _Outcome(degree, u, distance, evidence)

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
        start: Array | None = None,
    ) -> tuple[Array, Array, Array]:
        """Gauss-Newton for the degree; returns degree, effect (n, rank), residuals (n, rank)."""
        flows = self.observed.flows[self.valid][:, self.members].copy()
        degree = np.zeros(len(self.members)) if start is None else start
        top = fault.highest * (1.0 - 1e-6)
        reached = self.basis[:, places]
        for step in range(STEPS + 1):
            values, slopes = undone(degree)
            flows[places] = values
            residuals = np.einsum("ro,on->nr", self.basis, flows)
            effect = np.einsum("ro,on->nr", reached, slopes)
            if step == STEPS:
                break
            solved = _solve(covariance, effect)
            top_part = np.einsum("nr,nr->n", solved, residuals)
            bottom = np.einsum("nr,nr->n", solved, effect)
            with np.errstate(divide="ignore", invalid="ignore"):
                change = -top_part / bottom
            change = np.where(np.isfinite(change), change, 0.0)
            limit = 0.5 * (1.0 + np.abs(degree))
            new = np.clip(degree + np.clip(change, -limit, limit), fault.lowest, top)
            degree = new
        return degree, effect, residuals

    def _widened(self, fault: FaultSpec, undone: Undone, degree: Array, places: list[int]) -> Array:
        """Covariance plus the tolerance of the fault: a real one never looks quite like its law.

        Each observer's own part of the effect may be off by the tolerance, independently.
        """
        _, slopes = undone(degree)
        spread = fault.tolerance * degree * slopes
        parts = np.einsum("ro,on->nro", self.basis[:, places], spread)
        widened: Array = self.covariance + parts @ np.swapaxes(parts, 1, 2)
        return widened


def fits_by_fault(ruleset: Ruleset, isolation: Isolation, point: int) -> Mapping[str, float]:
    """Probabilities of the faults that fit at a point, the most probable first."""
    chances = isolation.probability[:, point]
    order = np.argsort(-chances, kind="stable")
    return {ruleset.faults[i].id: float(chances[i]) for i in order if chances[i] > 0}
