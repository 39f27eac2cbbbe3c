"""Redundancy: what several estimates of the same flows say beyond the flows themselves."""

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Junction, Ruleset
from rulec_runtime.diagnosis.steady import limits


def blocks_of(ruleset: Ruleset) -> list[np.ndarray]:
    """Blocks of estimates that check each other, as flags of the observers, by their first
    observer.

    Pumps that feed one channel without a flow meter, say, are a block each: a fault in one says
    nothing about the next, so they are judged apart. One block of everything if nothing is
    redundant.
    """
    every = np.ones(len(ruleset.observers), dtype=bool)
    basis = residual_basis(ruleset, every)
    linked = np.abs(basis.T @ basis) > common.LINKED
    left = {int(i) for i in np.flatnonzero(linked.any(axis=0))}
    blocks = []
    while left:
        members: set[int] = set()
        front = {min(left)}
        while front:
            members |= front
            front = {int(j) for i in front for j in np.flatnonzero(linked[i])} - members
        left -= members
        blocks.append(np.isin(np.arange(len(every)), sorted(members)))
    return blocks or [every]


def chi_square_limit(freedom: int, quantile: float) -> float:
    """Quantile of chi-square for a normal quantile (Wilson and Hilferty 1931)."""
    part = 2.0 / (9.0 * freedom)
    return float(freedom * (1.0 - part + quantile * np.sqrt(part)) ** 3)


def residual_basis(ruleset: Ruleset, valid: np.ndarray) -> Array:
    """Independent combinations of valid observers that vanish in a healthy plant.

    The flows of all modules obey the junction balances; observers are redundant beyond one value
    per free flow. Shape (rank, valid observers), orthonormal rows.
    """
    of_observers = zip(ruleset.observers, valid, strict=True)
    chosen = tuple(observer.module for observer, usable in of_observers if usable)
    return _basis(tuple(ruleset.modules), ruleset.junctions, chosen)


def has_many(ruleset: Ruleset) -> bool:
    """Whether so many estimates check each other that tables of all of them cost too much."""
    every = np.ones(len(ruleset.observers), dtype=bool)
    # A basis is expensive, and there are never more residuals than estimates.
    few = len(every) < limits.MANY_RESIDUALS
    return not few and len(residual_basis(ruleset, every)) >= limits.MANY_RESIDUALS


def at_once(ruleset: Ruleset) -> int:
    """Points whose covariances are worked on together."""
    most = limits.ESTIMATES_AT_ONCE // max(len(ruleset.observers), 1) ** 2
    return min(max(most, 1), limits.POINTS_AT_ONCE)


def free_flows(ruleset: Ruleset) -> Array:
    """Flows through all modules by those that are free, shape (modules, free flows)."""
    return _free_flows(tuple(ruleset.modules), ruleset.junctions)


@lru_cache(maxsize=256)
def _basis(
    modules: tuple[str, ...], junctions: tuple[Junction, ...], chosen: tuple[str, ...]
) -> Array:
    """The basis for estimates of the flows through chosen modules; every batch needs it."""
    column = {name: i for i, name in enumerate(modules)}
    free = _free_flows(modules, junctions)
    basis = _null_space(free[[column[name] for name in chosen]].T).T
    basis.setflags(write=False)
    return basis


@lru_cache(maxsize=16)
def _free_flows(modules: tuple[str, ...], junctions: tuple[Junction, ...]) -> Array:
    column = {name: i for i, name in enumerate(modules)}
    balances = np.zeros((len(junctions), len(modules)))
    for row, junction in zip(balances, junctions, strict=True):
        for name in junction.outlets:
            row[column[name]] += 1.0
        for name in junction.inlets:
            row[column[name]] -= 1.0
    return _null_space(balances)


def vanishing(flows: Array) -> Array:
    """Independent combinations of some flows, shape (flows, free), that vanish for any free flows:
    orthonormal, shape (rank, flows)."""
    return _null_space(flows.T).T


def patterns_of(valid: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Points with the same valid observers: flags, shape (observers,), and the points."""
    if valid.shape[1] and (valid == valid[:, :1]).all():
        yield valid[:, 0], np.arange(valid.shape[1])
        return
    patterns, group = np.unique(valid, axis=1, return_inverse=True)
    for i, pattern in enumerate(patterns.T):
        yield pattern, np.flatnonzero(np.ravel(group) == i)


def spread_evenly(
    valid: np.ndarray, members: Sequence[int] | np.ndarray, most: int = limits.STACKED
) -> tuple[np.ndarray, np.ndarray]:
    """Some stretches of a run, spread evenly, that share their usable observers, and flags of
    these; `valid` flags those of all stretches, shape (observers, n)."""
    chosen = np.asarray(members)
    patterns, group, counts = np.unique(
        valid[:, chosen], axis=1, return_inverse=True, return_counts=True
    )
    usual = int(np.argmax(counts))
    return thinned(chosen[np.ravel(group) == usual], most), patterns[:, usual]


def thinned(points: np.ndarray, most: int = limits.STACKED) -> np.ndarray:
    """At most so many points, spread evenly."""
    chosen = np.linspace(0, len(points) - 1, min(most, len(points))).round().astype(int)
    return np.asarray(points[chosen])


def groups_of(
    ruleset: Ruleset, valid: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, Array]]:
    """The same for estimates that check each other only, with their residual basis."""
    for pattern, members in patterns_of(valid):
        basis = residual_basis(ruleset, pattern)
        if len(basis):
            yield pattern, members, basis


def covariance_of(basis: Array, covariance: Array, valid: np.ndarray, members: np.ndarray) -> Array:
    """Covariance of residuals, shape (members, rank, rank), from that of all observers."""
    own = covariance[np.ix_(members, valid, valid)]
    return np.asarray(basis @ own @ basis.T)


def _null_space(matrix: Array) -> Array:
    """Orthonormal basis of the null space, shape (columns, dimension)."""
    if not matrix.size:
        return np.eye(matrix.shape[1])
    _, sizes, rows = np.linalg.svd(matrix)
    rank = int(np.sum(sizes > limits.NULL_SPACE * max(sizes.max(initial=0.0), 1.0)))
    return rows[rank:].T
