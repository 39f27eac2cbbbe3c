"""Two explanations at once, where each alone is hidden by the other."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from runtime.mismatch.compete import cost_of, refit
from runtime.mismatch.fit import Fitted, fit
from runtime.mismatch.screen import Trial, columns_of, looks_at, screen
from runtime.plan import Array

PAIRED = 12
"""Single trials of which pairs are made."""

MORE = 1.5
"""A pair that hides itself gains this many times what its parts gain alone, linearised."""

TWINS = 0.9
"""Cosine of two terms from which on they are no pair."""

TRIED = 2

BEGUN = 4
"""Single explanations, under a calibration that holds, to which a second is looked for."""


def pair_trials(fitted: Fitted, trials: Sequence[Trial]) -> list[tuple[Fitted, Trial]]:
    """Refits with the two explanations of the most promising pairs whose parts hide each other."""
    single = (t for t in trials if not t.candidate.members)
    chosen = sorted(single, key=lambda t: -t.held)[:PAIRED]
    columns = [columns_of(fitted, t.candidate, _at_null(t), t.fixed) for t in chosen]
    looks = looks_at(fitted)
    found: list[tuple[float, Trial, Trial]] = []
    for (i, first), (j, second) in itertools.combinations(enumerate(chosen), 2):
        a, b = columns[i], columns[j]
        if a is None or b is None or first.candidate.name == second.candidate.name:
            continue
        if _twins(a, b):
            continue
        both = np.concatenate([a, b], axis=1)
        wide = np.full(both.shape[1], np.inf)
        gain = max(look.best(both, -wide, wide)[1] for look in looks)
        if gain > MORE * (first.held + second.held):
            found.append((gain, first, second))
    found.sort(key=lambda f: -f[0])
    return [_refitted(fitted, first, second) for _, first, second in found[:TRIED]]


def held_pairs(fitted: Fitted, trials: Sequence[Trial]) -> list[tuple[Fitted, Trial]]:
    """Refits with pairs that may do what a calibration does that is let go: it holds here."""
    single = [t for t in trials if not t.candidate.members]
    found: dict[frozenset[str], tuple[Fitted, Trial]] = {}
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
    fitted: Fitted,
    torn: Sequence[tuple[Fitted, Trial]],
    seconds: Callable[[Fitted], Sequence[Trial]],
) -> list[tuple[Fitted, Trial]]:
    """Refits with a second explanation beside single ones that gain enough and yet do not win.

    `torn` are these as refitted; `seconds` tells what may stand beside one that is there already.
    """
    found: dict[frozenset[str], tuple[Fitted, Trial]] = {}
    for begun, first in torn[:BEGUN]:
        for second in seconds(begun):
            pair = frozenset((first.candidate.id, second.candidate.id))
            if len(pair) > 1 and pair not in found:
                found[pair] = _refitted(fitted, first, second)
    return list(found.values())


def _twins(first: Array, second: Array) -> bool:
    """Do two terms look alike? Their difference would explain anything small."""
    size = np.linalg.norm(first, axis=0)[:, None] * np.linalg.norm(second, axis=0)
    return bool(np.max(np.abs(first.T @ second) / np.maximum(size, 1e-300)) > TWINS)


def _at_null(trial: Trial) -> dict[str, float]:
    """Values of a trial with its amplitudes at their null."""
    null = {u.id: u.null for u in trial.candidate.unknowns if u.null is not None}
    return {name: null.get(name, value) for name, value in trial.values.items()}


def _refitted(fitted: Fitted, first: Trial, second: Trial) -> tuple[Fitted, Trial]:
    """Both joined; the second stands along with the first."""
    setting = fitted.setting.joining(second.candidate, second.values, second.fixed, second.course)
    return refit(replace(fitted, setting=setting), replace(first, along=(second,)))
