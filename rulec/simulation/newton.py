"""Newton's method for many small systems of equations at once, direct or by continuation.

A system near a known solution is solved directly from there. If the steps do not shrink as they do
near a solution, continuation takes over: it solves a share of the way from the last solution
found, halves the stride of a system after a failure and doubles it after a success. Of several
solutions it thus finds the one that the known solution turns into.
"""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from rulec.simulation import limits

Index = NDArray[np.intp]


ROWS, ENTRIES = 4096, 2_000_000
"""Systems per batch, and entries of their matrices; more do not fit into the cache."""


class Systems(Protocol):
    """n systems of m equations with m unknowns near 1, on the way from share 0 to share 1."""

    def linearised(self, at: Array, share: Array, index: Index) -> tuple[Array, Array]:
        """Residuals of the systems `index`, shape (k, m), and their derivatives, shape (k, m, m).

        NaN where a law does not hold.
        """


def follow(systems: Systems, start: Array, index: Index) -> tuple[Array, Array]:
    """Solve the systems `index` from `start`, shape (k, m), near the solutions at share 0.

    Returns solutions, shape (k, m), and the share reached, shape (k,): 1 where the system is
    solved, -1 where not even share 0 is. Below 1 the solution is the last one on the way.
    """
    at, solved = start.copy(), np.zeros(len(start), dtype=bool)
    for part in _batches(np.arange(len(start)), start, ROWS):
        at[part], solved[part] = straight(systems, start[part], np.ones(len(part)), index[part])
    reached = np.ones(len(at))
    # Few are far away, and continuation takes many small calls, so these go together.
    for part in _batches(np.flatnonzero(~solved), start, ENTRIES):
        at[part], reached[part] = _by_continuation(systems, start[part], index[part])
    return at, reached


def _batches(numbers: Index, start: Array, most: int) -> Iterator[Index]:
    size = max(1, min(most, ENTRIES // max(1, start.shape[1]) ** 2))
    for low in range(0, len(numbers), size):
        yield numbers[low : low + size]


def straight(
    systems: Systems, start: Array, share: Array, index: Index
) -> tuple[Array, NDArray[np.bool_]]:
    """Full Newton steps, as long as they shrink; returns where they end, and which converged."""
    at, solved = start.copy(), np.zeros(len(start), dtype=bool)
    live, bound = np.arange(len(start)), np.full(len(start), np.inf)
    while live.size:
        left, slopes = systems.linearised(at[live], share[live], index[live])
        step = _solve_each(slopes, -left)
        longest = np.abs(step).max(axis=1)
        near = longest <= np.maximum(bound[live], limits.NEWTON_CONVERGED)
        live, step, longest = live[near], step[near], longest[near]
        at[live] += step
        bound[live] = limits.SHRINKS * longest
        done = longest < limits.NEWTON_CONVERGED
        solved[live[done]] = True
        live = live[~done]
    return at, solved


def _by_continuation(systems: Systems, start: Array, index: Index) -> tuple[Array, Array]:
    """As `follow`, but always from share 0."""
    n = len(start)
    at, solved = straight(systems, start, np.zeros(n), index)
    reached, stride = np.where(solved, 0.0, -1.0), np.full(n, limits.FIRST_SHARE)
    while True:
        under_way = (reached >= 0.0) & (reached < 1.0)
        live = np.flatnonzero(under_way & (stride >= limits.SHORTEST_SHARE))
        if not live.size:
            return at, reached
        share = np.minimum(reached[live] + stride[live], 1.0)
        found, solved = straight(systems, at[live], share, index[live])
        at[live[solved]] = found[solved]
        reached[live] = np.where(solved, share, reached[live])
        stride[live] *= np.where(solved, 2.0, 0.5)


def _solve_each(matrices: Array, right: Array) -> Array:
    """Solve k linear systems, shape (k, m); NaN where a matrix is singular or not finite."""
    sound = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    safe = np.where(sound[:, None, None], matrices, np.eye(matrices.shape[1]))
    result: Array
    try:
        result = np.asarray(np.linalg.solve(safe, right[:, :, None]), dtype=float)[:, :, 0]
    except np.linalg.LinAlgError:
        # numpy refuses all because of one; alone, each has the same solution as among others.
        result = np.full_like(right, np.nan)
        if len(right) > 1:
            parts = [slice(i, i + 1) for i in range(len(right))]
            result = np.concatenate([_solve_each(safe[p], right[p]) for p in parts])
    result[~sound] = np.nan
    return result
