"""Terms without a name beside laws and other terms: their gain, and which contain which."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.evidence import Evidence
from rulec.mismatch.evidence.term import Term
from rulec.mismatch.search import limits
from rulec.mismatch.search.refit import Model


def holds(terms: Iterable[Term], slopes: Array) -> bool:
    """Is a law, by its slopes, shape (open rows,), a special case of some term?

    Differences within the error of form of the law do not count.
    """
    size = float(slopes @ slopes)
    for term in terms:
        left = slopes - term.columns @ np.linalg.lstsq(term.columns, slopes, rcond=None)[0]
        if float(left @ left) < limits.EFFECT_FORM**2 * size:
            return True
    return False


def beside(model: Model, every: Sequence[Term]) -> list[Term]:
    """The terms that neither contain nor are contained in a law or a term of a model."""
    laws = [slopes for candidate in model.setting.joined for slopes in slopes_of(model, candidate)]
    return [
        term
        for term in every
        if not any(holds([term], slopes) for slopes in laws)
        and not any(_whole(term, own) or _whole(own, term) for own in model.terms)
    ]


def coincide(
    evidence: Evidence, model: Model, candidate: Candidate, other: Model, rival: Candidate
) -> bool:
    """Does an explanation of a model show the same as one of another model, with all else refitted?

    Differences within the errors of form of their laws do not count.
    """
    own = [i for u in candidate.unknowns for i in places_of(model, u.id)]
    rest = np.delete(np.arange(model.table.shape[1]), own)
    table, weights = model.table[:, rest], model.weights[:, None]
    normal = table.T @ (table * weights) + model.precision[np.ix_(rest, rest)]
    both = [*slopes_of(model, candidate), *slopes_of(other, rival)]
    shown = evidence.whitened(np.stack(both, axis=1), model.noise)
    with np.errstate(all="ignore"):
        shown = shown - table @ np.linalg.solve(normal, table.T @ (shown * weights))
    shown = shown * np.sqrt(weights)
    count = len(slopes_of(model, candidate))
    first, second = shown[:, :count], shown[:, count:]
    left = second - first @ np.linalg.lstsq(first, second, rcond=None)[0]
    size = np.sum(second**2, axis=0)
    return bool(np.all(np.sum(left**2, axis=0) < limits.EFFECT_FORM**2 * size))


def places_of(model: Model, unknown: str) -> list[int]:
    """Columns of an unknown, with all its levels, in the table of a model."""
    names = enumerate(model.prior.names)
    return [i for i, name in names if name.partition("#")[0] == unknown]


def _whole(term: Term, other: Term) -> bool:
    """Does one term contain another, as at two places that show alike?"""
    return all(holds([term], column) for column in other.columns.T)


def slopes_of(model: Model, candidate: Candidate) -> list[Array]:
    """Slopes of the residuals by the amplitudes of a law, at its fitted values."""
    strengths = [u.id for u in candidate.unknowns if u.null is not None]
    columns = (model.raw[:, i] for name in strengths for i in places_of(model, name))
    return [column for column in columns if np.any(column)]


def nameless(
    evidence: Evidence, model: Model, every: Sequence[Term], most: int
) -> list[tuple[float, Term]]:
    """The terms that gain most beside a model, with their gain in log odds to first order."""
    found = []
    for term in every:
        gram, moment = model.beside(evidence.whitened(term.columns, model.noise))
        own, ways = np.linalg.eigh(gram)
        square, own = (ways.T @ moment) ** 2, np.maximum(own, 0.0)
        gains = [
            0.5 * float(np.sum(square / (own + s**-2.0)) - np.sum(np.log1p(own * s**2)))
            for s in common.TERM_SIZES
        ]
        count = len(every) * len(common.TERM_SIZES)
        odds = max(gains) + limits.TERM_ODDS - term.basis.price - float(np.log(count))
        found.append((odds, term))
    return sorted(found, key=lambda f: -f[0])[:most]
