"""Two explanations at once, where each alone is hidden by the other.

A pump that starts late and an outlet that lets too much through: alone each gains next to nothing,
as the plain model makes up for it, and none of the models that are carried along has either. So all
pairs are looked at, by one linear step from the plain model.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch.evidence.steady.screen import ScoreTest
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.search import limits
from rulec.mismatch.search.pair_gains import pair_gains
from rulec.mismatch.search.stores.beam import Task
from rulec.mismatch.search.stores.searcher import Searcher


@dataclass(frozen=True)
class _Term:
    """A candidate begun somewhere: `columns`, shape (rows, strengths), change the errors."""

    candidate: Candidate
    columns: Array
    low: Array
    high: Array


def hiding_pairs(
    searcher: Searcher, plain: Fitted, candidates: Sequence[Candidate], least: float
) -> list[Task]:
    """Pairs that gain more than any single explanation, and much more than both for themselves.

    `least` is the gain, made linear, below which none is worth a fit.
    """
    residual, slopes = searcher.linear(plain)
    terms = list(_terms(searcher, plain, candidates, len(residual)))
    if len(terms) < 2:
        return []
    look = ScoreTest(
        weights=np.ones(len(residual)),
        residual=residual,
        jacobian=slopes,
        inverse=np.asarray(np.linalg.pinv(slopes.T @ slopes, hermitian=True), dtype=float),
        pull=np.zeros(slopes.shape[1]),  # strains of the priors are rows like errors
        total=float(residual @ residual),
        count=max(round(searcher.news(plain)), 2),
    )
    alone: dict[str, float] = {}
    for term in terms:
        gain = look.best(term.columns, term.low, term.high)[1]
        alone[term.candidate.id] = max(gain, alone.get(term.candidate.id, 0.0))
    names, columns = [t.candidate.name for t in terms], [t.columns for t in terms]
    low, high = np.concatenate([t.low for t in terms]), np.concatenate([t.high for t in terms])
    best: dict[tuple[str, str], tuple[float, Task]] = {}
    for (i, j), gain in pair_gains([look], names, columns, low, high).items():
        one, other = terms[i].candidate, terms[j].candidate
        enough = max(
            least, *alone.values(), limits.PAIR_GAINS_MORE * (alone[one.id] + alone[other.id])
        )
        known = best.get((one.id, other.id))
        if gain > enough and (known is None or gain > known[0]):
            best[one.id, other.id] = gain, (plain, (one, other))
    ranked = sorted(best.items(), key=lambda found: (-found[1][0], found[0]))
    return [task for _, (_, task) in ranked[: limits.PAIRS_REFITTED]]


def _terms(
    searcher: Searcher, plain: Fitted, candidates: Sequence[Candidate], rows: int
) -> Iterator[_Term]:
    """Candidates from each of their starts: a threshold elsewhere makes another term of one."""
    for candidate in candidates:
        for columns, low, high in searcher.changes(plain, candidate):
            if not np.isfinite(columns).all():
                continue
            padded = np.vstack([columns, np.zeros((rows - len(columns), columns.shape[1]))])
            yield _Term(candidate, padded, low, high)
