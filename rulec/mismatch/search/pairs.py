"""Two explanations at once, where each alone is hidden by the other."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.screen import (
    InitialCandidate,
    columns_of,
    score_tests_at,
    screen,
)
from rulec.mismatch.search.compete import CrossValidated, Refit, cost_of, refit
from rulec.mismatch.search.pair_gains import pair_gains
from rulec.mismatch.search.periods import coming_and_going, periods_of


def pair_trials(fitted: Fitted, trials: Sequence[InitialCandidate], least: float) -> list[Refit]:
    """Refits with the two explanations of the most promising pairs whose parts hide each other.

    All pairs are looked at: of two that hide each other one may show nothing alone. `least` is the
    gain, linearised, below which none is refitted.
    """
    single = [t for t in trials if not t.candidate.members]
    drawn = [(t, columns_of(fitted, t.candidate, _at_null(t), t.fixed)) for t in single]
    terms = [(t, columns) for t, columns in drawn if columns is not None]
    if len(terms) < 2:
        return []
    names, columns = [t.candidate.name for t, _ in terms], [c for _, c in terms]
    low, high = np.concatenate([_ends(t) for t, _ in terms]).T
    found = []
    for (i, j), gain in pair_gains(score_tests_at(fitted), names, columns, low, high).items():
        first, second = terms[i][0], terms[j][0]
        if gain > max(least, limits.PAIR_GAINS_MORE * (first.held + second.held)):
            found.append((gain, first, second))
    found.sort(key=lambda f: (-f[0], f[1].candidate.id, f[2].candidate.id))
    return [_refitted(fitted, first, second) for _, first, second in found[: limits.PAIRS_REFITTED]]


def _ends(trial: InitialCandidate) -> Array:
    """Between which amplitudes those of a trial may lie, shape (amplitudes, 2)."""
    ends = [
        (u.lowest - u.null, u.highest - u.null)
        for u in trial.candidate.unknowns
        if u.null is not None and not u.fixed
    ]
    return np.array(ends).reshape(-1, 2)


def held_pairs(fitted: Fitted, trials: Sequence[InitialCandidate]) -> list[Refit]:
    """Refits with pairs that may do what a calibration does that is let go: it holds here."""
    single = [t for t in trials if not t.candidate.members]
    found: dict[frozenset[str], Refit] = {}
    begins = []
    for first in sorted(single, key=lambda t: -t.held)[: limits.PAIRED]:
        setting = fitted.setting.joining(first.candidate, first.values, first.fixed)
        begins.append(
            (
                fit(
                    fitted.rows, setting, fitted.used, variance_inflation=fitted.variance_inflation
                ),
                first,
            )
        )
    for begun, first in sorted(begins, key=lambda b: cost_of(b[0]))[: limits.BEGUN]:
        others = [t.candidate for t in single if t.candidate.name != first.candidate.name]
        seconds = sorted(screen(begun, others), key=lambda t: -t.held)[: limits.SECONDS]
        for second in seconds:
            pair = frozenset((first.candidate.id, second.candidate.id))
            if pair not in found:
                found[pair] = _refitted(fitted, first, second)
    return list(found.values())


def torn_pairs(
    fitted: Fitted,
    torn: Sequence[CrossValidated],
    free: Sequence[Candidate],
    most: int = limits.BEGUN,
) -> list[Refit]:
    """Refits with a second explanation beside single ones that gain enough and yet do not win.

    `most` of these are tried, the best in the sample first.
    """
    found: dict[frozenset[str], Refit] = {}
    for begun, first in _alone(torn)[:most]:
        for second in _seconds(begun, free):
            pair = frozenset((first.candidate.id, second.candidate.id))
            if len(pair) > 1 and pair not in found:
                found[pair] = _refitted(fitted, first, second)
    return list(found.values())


def _alone(torn: Sequence[CrossValidated]) -> list[Refit]:
    """Single explanations, as they were refitted, the best in the sample first.

    What comes and goes more often imitates anything, and all the more beside another.
    """
    each = [(c.fitted, c.trial) for c in torn if c.trial is not None and not c.trial.along]
    single = [(fitted, trial) for fitted, trial in each if periods_of(trial) <= limits.FEW_CHANGES]
    return sorted(single, key=lambda s: cost_of(s[0]))


def _seconds(begun: Fitted, free: Sequence[Candidate]) -> list[InitialCandidate]:
    """What may stand beside an explanation that is there already: what lasts, and what begins."""
    joined = {c.id for c in begun.setting.joined}
    rest = [c for c in free if c.id not in joined]
    # Far from what was read a law may have no slope: then it lacks nothing that could be told.
    with contextlib.suppress(np.linalg.LinAlgError):
        return [
            *screen(begun, rest)[: limits.SECONDS],
            *coming_and_going(begun, rest, limits.FEW_CHANGES)[: limits.SECONDS],
        ]
    return []


def _at_null(trial: InitialCandidate) -> dict[str, float]:
    """Values of a trial with its amplitudes at their null."""
    null = {u.id: u.null for u in trial.candidate.unknowns if u.null is not None}
    return {name: null.get(name, value) for name, value in trial.values.items()}


def _refitted(fitted: Fitted, first: InitialCandidate, second: InitialCandidate) -> Refit:
    """Both joined; the second stands along with the first."""
    setting = fitted.setting.joining(second.candidate, second.values, second.fixed, second.course)
    return refit(replace(fitted, setting=setting), replace(first, along=(second,)))
