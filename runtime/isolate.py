"""Which fault fits: every hypothesis against the whole residual vector, degree free.

A hypothesis is tested by undoing it. With the right degree of the right fault put into the
observers, all estimates of a flow agree within their uncertainty. The degree is found by
generalised least squares (a few Gauss-Newton steps), in the metric of the residuals' covariance,
so a residual that a fault leaves at zero counts as much as one that it moves.

Source: own derivation, see docs/method.md; generalised least squares as in any textbook.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from runtime.hypothesis import HypothesisTest, covariance_of, distance_of
from runtime.observe import Observed
from runtime.plan import Array
from runtime.ruleset import Ruleset

ALARM = 4.0
"""Normal quantile of the test that something is wrong at all (3e-5 a point)."""

ACCEPT = 3.0
"""Normal quantile up to which a hypothesis counts as fitting (1e-3)."""


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
    covariance = covariance_of(observed.gradients[valid][:, :, members], basis)
    residuals = np.einsum("ro,on->nr", basis, flows)
    misfit = distance_of(covariance, residuals)
    result.judged[members] = True
    result.misfit[members] = misfit
    result.freedom[members] = len(basis)
    deviating = misfit > chi_square_limit(len(basis), ALARM)
    result.deviating[members] = deviating
    every = HypothesisTest(ruleset, observed, valid, basis, members, covariance)
    for i, fault in enumerate(ruleset.faults):
        result.floor[i, members] = every.floor(fault)
    if not deviating.any():
        return
    chosen = members[deviating]
    test = HypothesisTest(ruleset, observed, valid, basis, chosen, covariance[deviating])
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
