"""What each pair of terms would explain, by one linear step: all pairs of a plant at once."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.steady.screen import ScoreTest
from rulec.mismatch.search import limits


def pair_gains(
    looks: Sequence[ScoreTest],
    names: Sequence[str],
    terms: Sequence[Array],
    low: Array,
    high: Array,
) -> dict[tuple[int, int], float]:
    """Gains of all pairs of terms with other names that do not look alike, under the better look.

    Parameters
    ----------
    terms : columns of each term, shape (rows, its amplitudes)
    low, high : ends of the amplitudes of all terms, shape (amplitudes,)
    """
    table = np.concatenate(terms, axis=1)
    ends = np.cumsum([0, *(columns.shape[1] for columns in terms)])
    parts = [range(a, b) for a, b in itertools.pairwise(ends.tolist())]
    size = np.maximum(np.linalg.norm(table, axis=0), 1e-150)
    cosine = np.abs(table.T @ table) / np.outer(size, size)
    by_size: dict[int, list[tuple[int, int]]] = {}
    for i, j in itertools.combinations(range(len(terms)), 2):
        # The difference of twins would explain anything small.
        if names[i] != names[j] and cosine[np.ix_(parts[i], parts[j])].max() <= limits.NO_PAIR:
            by_size.setdefault(len(parts[i]) + len(parts[j]), []).append((i, j))
    gains: dict[tuple[int, int], float] = {}
    for pairs in by_size.values():
        sets = np.array([[*parts[i], *parts[j]] for i, j in pairs])
        each = np.max([look.best_of(table, sets, low, high)[1] for look in looks], axis=0)
        gains.update(zip(pairs, each.tolist(), strict=True))
    return gains
