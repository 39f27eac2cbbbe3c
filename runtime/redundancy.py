"""What several estimates of the same flows say beyond the flows themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from runtime.plan import Array
from runtime.ruleset import FaultSpec, ObserverSpec, ResidualSpec, Ruleset

LINKED = 1e-9
"""Share of an estimate in another's redundancy above which both belong to one block."""


@dataclass(frozen=True)
class Block:
    """Estimates that check each other, and no others; `observers` flags those of the ruleset.

    Pumps that feed one channel without a flow meter, say, are a block each: what is wrong in one
    says nothing of the next, so they are judged apart.
    """

    observers: np.ndarray

    def holds(self, ruleset: Ruleset, part: ObserverSpec | ResidualSpec | FaultSpec) -> bool:
        """Does an observer, a residual or a fault concern the block?"""
        if isinstance(part, ObserverSpec):
            names: tuple[str, ...] = (part.id,)
        elif isinstance(part, ResidualSpec):
            names = tuple(t.observer for t in part.terms)
        else:
            names = part.affects
        return any(self.observers[ruleset.observer_index[name]] for name in names)


def blocks_of(ruleset: Ruleset) -> list[Block]:
    """Blocks in order of their first observer; one of everything where nothing is redundant."""
    every = np.ones(len(ruleset.observers), dtype=bool)
    basis = residual_basis(ruleset, every)
    linked = np.abs(basis.T @ basis) > LINKED
    left = {int(i) for i in np.flatnonzero(linked.any(axis=0))}
    blocks = []
    while left:
        members: set[int] = set()
        front = {min(left)}
        while front:
            members |= front
            front = {int(j) for i in front for j in np.flatnonzero(linked[i])} - members
        left -= members
        blocks.append(Block(np.isin(np.arange(len(every)), sorted(members))))
    return blocks or [Block(every)]


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
