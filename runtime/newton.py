"""Newton's method for many small systems of equations at once, along a path of easier ones.

A system far from a known solution is reached by continuation: a share of the way there is solved
first, from the last solution found; the share of a system that fails is halved, of one that
succeeds doubled.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from runtime.plan import Array

Index = NDArray[np.intp]

STEPS = 30
"""Newton steps at most; a step that leads away is halved, and counts."""

CONVERGED = 1e-9
"""Last step, in units of the unknowns' scales. Newton squares it, so the result is better."""

LONGEST = 0.5
"""No step moves an unknown by more than this share of its scale: laws may end nearby."""

FIRST, SHORTEST = 0.25, 1.0 / 4096.0
"""Share of the way that is tried first, and below which the way counts as ended."""


class Systems(Protocol):
    """n systems of m equations with m unknowns near one, on the way from share 0 to share 1."""

    def residuals(self, at: Array, share: Array, index: Index) -> Array:
        """Residuals of the systems `index`, shape (k, m); NaN where a law does not hold."""

    def jacobian(self, at: Array, share: Array, index: Index) -> Array:
        """Their derivatives by the unknowns, shape (k, m, m)."""


def follow(systems: Systems, start: Array) -> tuple[Array, Array]:
    """Solve all systems from one starting point.

    Parameters
    ----------
    start : shape (n, m), near the solutions at share 0.

    Returns
    -------
    Solutions, shape (n, m), and the share that was reached, shape (n,): 1 where the system is
    solved, -1 where not even share 0 is. Short of 1 the solution is the last on the way.
    """
    n = len(start)
    at, solved = newton(systems, start, np.zeros(n), np.arange(n))
    reached, stride = np.where(solved, 0.0, -1.0), np.full(n, FIRST)
    while True:
        index = np.flatnonzero((reached >= 0.0) & (reached < 1.0) & (stride >= SHORTEST))
        if not index.size:
            return at, reached
        share = np.minimum(reached[index] + stride[index], 1.0)
        found, solved = newton(systems, at[index], share, index)
        at[index[solved]] = found[solved]
        reached[index] = np.where(solved, share, reached[index])
        stride[index] *= np.where(solved, 2.0, 0.5)


def newton(
    systems: Systems, start: Array, share: Array, index: Index
) -> tuple[Array, NDArray[np.bool_]]:
    """Damped Newton steps; returns where they led, shape (k, m), and which systems converged."""
    at = start.copy()
    left = systems.residuals(at, share, index)
    size = _length(left)
    damping, done = np.ones(len(at)), np.zeros(len(at), dtype=bool)
    for _ in range(STEPS):
        live = np.flatnonzero(~done & np.isfinite(size))
        if not live.size:
            break
        slopes = systems.jacobian(at[live], share[live], index[live])
        step = _solve_each(slopes, -left[live])
        longest = np.abs(step).max(axis=1)
        factor = damping[live] * LONGEST / np.maximum(longest, LONGEST)
        trial = at[live] + factor[:, None] * step
        trial_left = systems.residuals(trial, share[live], index[live])
        trial_size = _length(trial_left)
        # At the end only rounding is left, which need not fall any further.
        last: NDArray[np.bool_] = (longest < CONVERGED) & np.isfinite(trial_size)
        better: NDArray[np.bool_] = (trial_size < size[live]) | last
        moved = live[better]
        at[moved], left[moved], size[moved] = trial[better], trial_left[better], trial_size[better]
        damping[live] = np.where(better, np.minimum(2.0 * damping[live], 1.0), 0.5 * damping[live])
        done[live] = last
    return at, done


def _length(vectors: Array) -> Array:
    length: Array = np.sqrt(np.einsum("km,km->k", vectors, vectors))
    return length


def _solve_each(matrices: Array, right: Array) -> Array:
    """Solve k linear systems, shape (k, m); NaN where a matrix is singular or not finite."""
    sound = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    safe = np.where(sound[:, None, None], matrices, np.eye(matrices.shape[1]))
    result: Array
    try:
        result = np.asarray(np.linalg.solve(safe, right[:, :, None]), dtype=float)[:, :, 0]
    except np.linalg.LinAlgError:
        # numpy gives up on all for one; alone each is solved as it would be in any company.
        result = np.full_like(right, np.nan)
        if len(right) > 1:
            parts = [slice(i, i + 1) for i in range(len(right))]
            result = np.concatenate([_solve_each(safe[p], right[p]) for p in parts])
    result[~sound] = np.nan
    return result
