"""Solve many small systems of equations at once, one per point, with one unknown per output.

Up to two unknowns have a formula. Bounds of the condition mostly show whether a larger system is
singular; singular values, which cost ten times as much, decide doubtful cases.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence import limits


def inverses_of(tables: Sequence[Array]) -> list[Array]:
    """Invert several tables of matrices, shape (k, r, r), those of equal size together."""
    result = list(tables)
    for size in dict.fromkeys(table.shape[1] for table in tables):
        chosen = [i for i, table in enumerate(tables) if table.shape[1] == size]
        together = inverses(np.concatenate([tables[i] for i in chosen]))
        ends = np.cumsum([len(tables[i]) for i in chosen])
        for i, part in zip(chosen, np.split(together, ends[:-1]), strict=True):
            result[i] = part
    return result


def inverses(matrices: Array) -> Array:
    """Invert k matrices, shape (k, r, r); NaN where one is singular.

    Rows and columns are scaled before a system counts as singular, as unknowns differ in units.
    """
    if matrices.shape[1] == 1:
        return 1.0 / np.where(np.isfinite(matrices) & (matrices != 0.0), matrices, np.nan)
    sound = np.ones(len(matrices), dtype=bool)
    if not np.isfinite(matrices).all():
        sound = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
        matrices = np.where(sound[:, None, None], matrices, np.eye(matrices.shape[1]))
    rows = _size(matrices, 2)
    scaled = matrices / rows
    columns = _size(scaled, 1)
    scaled /= columns
    if matrices.shape[1] == 2:
        inverse, condition = _of_two(scaled)
        sound &= condition < limits.SINGULAR
    else:
        inverse = _of_many(scaled, sound)
    inverse /= np.swapaxes(columns, 1, 2)
    inverse /= np.swapaxes(rows, 1, 2)
    if not sound.all():
        inverse[~sound] = np.nan
    return inverse


def _size(matrices: Array, axis: int) -> Array:
    """Largest absolute entry along an axis, 1 where all are 0."""
    parts = np.moveaxis(np.abs(matrices), axis, 0)
    sizes = parts[0].copy()
    # One call of max over a short axis would be slow.
    for part in parts[1:]:
        np.maximum(sizes, part, out=sizes)
    sizes[sizes == 0.0] = 1.0
    return np.expand_dims(sizes, axis)


def _of_two(matrices: Array) -> tuple[Array, Array]:
    """Inverses and conditions, by the sum and the product of squared singular values."""
    a, b = matrices[:, 0, 0], matrices[:, 0, 1]
    c, d = matrices[:, 1, 0], matrices[:, 1, 1]
    inverse = np.empty_like(matrices)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        product = a * d - b * c
        squares = a * a + b * b + c * c + d * d
        root = np.sqrt(np.maximum(squares**2 - 4.0 * product**2, 0.0))
        condition: Array = (squares + root) / (2.0 * np.abs(product))
        inverse[:, 0, 0], inverse[:, 0, 1] = d / product, -b / product
        inverse[:, 1, 0], inverse[:, 1, 1] = -c / product, a / product
    return inverse, condition


def _of_many(matrices: Array, sound: np.ndarray) -> Array:
    """Inverses; clears `sound` for singular matrices."""
    try:
        inverse = np.asarray(np.linalg.inv(matrices), dtype=float)
    except np.linalg.LinAlgError:
        sound &= np.linalg.cond(matrices) < limits.SINGULAR
        matrices = np.where(sound[:, None, None], matrices, np.eye(matrices.shape[1]))
        return np.asarray(np.linalg.inv(matrices), dtype=float)
    # The product of Frobenius norms is at least the condition, and at most r times as much.
    bound = np.sqrt(_square(matrices)) * np.sqrt(_square(inverse))
    doubtful = ~(bound < limits.SINGULAR)
    if doubtful.any():
        sound[doubtful] &= np.linalg.cond(matrices[doubtful]) < limits.SINGULAR
    return inverse


def _square(matrices: Array) -> Array:
    flat = matrices.reshape(len(matrices), -1)
    return np.asarray(np.einsum("kn,kn->k", flat, flat))
