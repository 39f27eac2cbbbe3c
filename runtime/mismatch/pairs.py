"""Two explanations at once, where each alone is hidden by the other."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from runtime.mismatch.candidate import Candidate
from runtime.mismatch.compete import Contestant, Refit, cost_of, refit
from runtime.mismatch.fit import Fitted, fit
from runtime.mismatch.periods import FEW_CHANGES, coming_and_going, periods_of
from runtime.mismatch.screen import Trial, columns_of, looks_at, screen
from runtime.plan import Array

PAIRED = 12
"""Single trials to which a second is looked for, under a calibration that holds."""

MORE = 1.5
"""A pair that hides itself gains this many times what its parts gain alone, linearised."""

TWINS = 0.9
"""Cosine of two terms from which on they are no pair."""

TRIED = 2
"""Seconds that are tried beside each single explanation."""

REFITTED = 6
"""Pairs that hide each other that are refitted: some say nearly the same."""

BEGUN = 4
"""Single explanations, under a calibration that holds, to which a second is looked for."""


def pair_trials(fitted: Fitted, trials: Sequence[Trial], least: float) -> list[Refit]:
    """Refits with the two explanations of the most promising pairs whose parts hide each other.

    All pairs are looked at: of two that hide each other one may show nothing alone. `least` is the
    gain, linearised, below which none is refitted.
    """
    single = [t for t in trials if not t.candidate.members]
    drawn = [(t, columns_of(fitted, t.candidate, _at_null(t), t.fixed)) for t in single]
    terms = [(t, columns) for t, columns in drawn if columns is not None]
    if len(terms) < 2:
        return []
    gains = _pair_gains(fitted, terms)
    found = []
    for (i, j), gain in gains.items():
        first, second = terms[i][0], terms[j][0]
        if gain > max(least, MORE * (first.held + second.held)):
            found.append((gain, first, second))
    found.sort(key=lambda f: (-f[0], f[1].candidate.id, f[2].candidate.id))
    return [_refitted(fitted, first, second) for _, first, second in found[:REFITTED]]


def _pair_gains(
    fitted: Fitted, terms: Sequence[tuple[Trial, Array]]
) -> dict[tuple[int, int], float]:
    """Gains of all pairs of terms with other names that do not look alike, linearised."""
    table = np.concatenate([columns for _, columns in terms], axis=1)
    ends = np.cumsum([0, *(columns.shape[1] for _, columns in terms)])
    parts = [range(a, b) for a, b in itertools.pairwise(ends.tolist())]
    size = np.maximum(np.linalg.norm(table, axis=0), 1e-300)
    cosine = np.abs(table.T @ table) / np.outer(size, size)
    null = [{u.id: u.null for u in t.candidate.unknowns if u.null is not None} for t, _ in terms]
    bounds = [
        (u.lowest - null[k][u.id], u.highest - null[k][u.id])
        for k, (t, _) in enumerate(terms)
        for u in t.candidate.unknowns
        if u.id in null[k] and not u.fixed
    ]
    low, high = np.array(bounds).T
    by_size: dict[int, list[tuple[int, int]]] = {}
    for i, j in itertools.combinations(range(len(terms)), 2):
        same = terms[i][0].candidate.name == terms[j][0].candidate.name
        # The difference of twins would explain anything small.
        if not same and cosine[np.ix_(parts[i], parts[j])].max() <= TWINS:
            by_size.setdefault(len(parts[i]) + len(parts[j]), []).append((i, j))
    gains: dict[tuple[int, int], float] = {}
    looks = looks_at(fitted)
    for pairs in by_size.values():
        sets = np.array([[*parts[i], *parts[j]] for i, j in pairs])
        each = np.max([look.best_of(table, sets, low, high)[1] for look in looks], axis=0)
        gains.update(zip(pairs, each.tolist(), strict=True))
    return gains


def held_pairs(fitted: Fitted, trials: Sequence[Trial]) -> list[Refit]:
    """Refits with pairs that may do what a calibration does that is let go: it holds here."""
    single = [t for t in trials if not t.candidate.members]
    found: dict[frozenset[str], Refit] = {}
    begins = []
    for first in sorted(single, key=lambda t: -t.held)[:PAIRED]:
        setting = fitted.setting.joining(first.candidate, first.values, first.fixed)
        begins.append((fit(fitted.rows, setting, fitted.used, temper=fitted.temper), first))
    for begun, first in sorted(begins, key=lambda b: cost_of(b[0]))[:BEGUN]:
        others = [t.candidate for t in single if t.candidate.name != first.candidate.name]
        seconds = sorted(screen(begun, others), key=lambda t: -t.held)[:TRIED]
        for second in seconds:
            pair = frozenset((first.candidate.id, second.candidate.id))
            if pair not in found:
                found[pair] = _refitted(fitted, first, second)
    return list(found.values())


def torn_pairs(
    fitted: Fitted, torn: Sequence[Contestant], free: Sequence[Candidate]
) -> list[Refit]:
    """Refits with a second explanation beside single ones that gain enough and yet do not win."""
    found: dict[frozenset[str], Refit] = {}
    for begun, first in _alone(torn)[:BEGUN]:
        for second in _seconds(begun, free):
            pair = frozenset((first.candidate.id, second.candidate.id))
            if len(pair) > 1 and pair not in found:
                found[pair] = _refitted(fitted, first, second)
    return list(found.values())


def _alone(torn: Sequence[Contestant]) -> list[Refit]:
    """Single explanations, as they were refitted, the best in the sample first.

    What comes and goes more often imitates anything, and all the more beside another.
    """
    each = [(c.fitted, c.trial) for c in torn if c.trial is not None and not c.trial.along]
    single = [(fitted, trial) for fitted, trial in each if periods_of(trial) <= FEW_CHANGES]
    return sorted(single, key=lambda s: cost_of(s[0]))


def _seconds(begun: Fitted, free: Sequence[Candidate]) -> list[Trial]:
    """What may stand beside an explanation that is there already: what lasts, and what begins."""
    joined = {c.id for c in begun.setting.joined}
    rest = [c for c in free if c.id not in joined]
    # Far from what was read a law may have no slope: then it lacks nothing that could be told.
    with contextlib.suppress(np.linalg.LinAlgError):
        return [*screen(begun, rest)[:TRIED], *coming_and_going(begun, rest, FEW_CHANGES)[:TRIED]]
    return []


def _at_null(trial: Trial) -> dict[str, float]:
    """Values of a trial with its amplitudes at their null."""
    null = {u.id: u.null for u in trial.candidate.unknowns if u.null is not None}
    return {name: null.get(name, value) for name, value in trial.values.items()}


def _refitted(fitted: Fitted, first: Trial, second: Trial) -> Refit:
    """Both joined; the second stands along with the first."""
    setting = fitted.setting.joining(second.candidate, second.values, second.fixed, second.course)
    return refit(replace(fitted, setting=setting), replace(first, along=(second,)))
