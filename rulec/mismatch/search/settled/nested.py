"""Terms without a name that hold a law as a special case: either is told, never both."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch.search import limits
from rulec.mismatch.search.settled.geometry import Term
from rulec.mismatch.search.settled.refit import Model


def holds(terms: Iterable[Term], slopes: Array) -> bool:
    """Is a law, by its slopes, shape (seen rows,), a special case of some term?

    A law may have an error of form: what differs less than that is the same.
    """
    size = float(slopes @ slopes)
    for term in terms:
        left = slopes - term.columns @ np.linalg.lstsq(term.columns, slopes, rcond=None)[0]
        if float(left @ left) < limits.EFFECT_FORM**2 * size:
            return True
    return False


def beside(model: Model, every: Sequence[Term]) -> list[Term]:
    """The terms that hold no law and no term of a model, and are held by none."""
    laws = [slopes for candidate in model.setting.joined for slopes in _slopes(model, candidate)]
    return [
        term
        for term in every
        if not any(holds([term], slopes) for slopes in laws)
        and not any(_whole(term, own) or _whole(own, term) for own in model.terms)
    ]


def _whole(term: Term, other: Term) -> bool:
    """Does one term hold another whole, as at two places that show alike?"""
    return all(holds([term], column) for column in other.columns.T)


def _slopes(model: Model, candidate: Candidate) -> list[Array]:
    """Slopes of the residuals by the strengths of a law, where it has been fitted."""
    strengths = {u.id for u in candidate.unknowns if u.null is not None}
    return [
        model.table[:, i]
        for i, name in enumerate(model.prior.names)
        if name in strengths and np.any(model.table[:, i])
    ]
