"""Explanations exchanged in the end, one or two at once: each was chosen beside the others.

Of two laws that are left out, the one that stands for both at first need be neither of them; and
once it is there, the second is chosen to fit it. Each alone is then better than its exchange.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.configuration import HIDDEN
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.evidence.steady.screen import InitialCandidate
from rulec.mismatch.search.accepted import Won
from rulec.mismatch.search.compete import CrossValidated, contest
from rulec.mismatch.search.rivals import at_an_end
from rulec.mismatch.search.weigh import net_gain, odds_of


def exchanged(
    now: CrossValidated, accepted: Sequence[Won]
) -> tuple[CrossValidated, tuple[Won, ...]]:
    """The model and its explanations, one or two of them exchanged where others do better."""
    records = list(accepted)
    for i, j in itertools.combinations(range(len(records)), 2):
        pair = records[i], records[j]
        if not all(_lasts(r) for r in pair) or not _near(*pair):
            continue
        tried = [(_with(now, pair, trials), trials) for trials in _combinations(*pair)]
        ahead = [t for t in tried if net_gain(t[0], now) > 0.0 and _within(t[0])]
        if ahead:
            now, trials = max(ahead, key=lambda t: net_gain(t[0], now))
            for k, trial, old in ((i, trials[0], pair[0]), (j, trials[1], pair[1])):
                others = [t for t in (old.trial, *old.others[: limits.OTHERS]) if t is not trial]
                records[k] = weighed(now, replace(old, trial=trial), others)
    return now, tuple(records)


def _within(model: CrossValidated) -> bool:
    """Is nothing at an end of its range? A pump of which all returns explains anything."""
    return not at_an_end(model, *model.fitted.setting.joined)


def _lasts(record: Won) -> bool:
    """Is it there all the time, with a law or a sensor to blame?"""
    return record.trial.course is None and record.trial.candidate.sort not in ("free", HIDDEN)


def _near(one: Won, other: Won) -> bool:
    """Do both concern one module?"""
    return bool(set(one.trial.candidate.modules) & set(other.trial.candidate.modules))


def _combinations(one: Won, other: Won) -> Iterator[tuple[InitialCandidate, InitialCandidate]]:
    """One or both of them exchanged."""
    taken = {one.trial.candidate.id, other.trial.candidate.id}
    first, second = (
        [
            r.trial,
            *[t for t in r.others if t.course is None and t.candidate.id not in taken][
                : limits.OTHERS
            ],
        ]
        for r in (one, other)
    )
    for a, b in itertools.product(first, second):
        if a.candidate.id != b.candidate.id and (a is not one.trial or b is not other.trial):
            yield a, b


def _with(
    now: CrossValidated, pair: tuple[Won, Won], trials: tuple[InitialCandidate, InitialCandidate]
) -> CrossValidated:
    """The model with other explanations in place of a pair."""
    gone = [r.trial.candidate.id for r in pair]
    return _model(now, gone, trials)


def _model(
    now: CrossValidated, gone: Sequence[str], new: Sequence[InitialCandidate]
) -> CrossValidated:
    """The model with some explanations exchanged."""
    fitted, setting = now.fitted, now.fitted.setting
    for name in gone:
        setting = setting.leaving(name)
    for trial in new:
        setting = setting.joining(trial.candidate, trial.values, trial.fixed)
    return contest(
        fit(fitted.rows, setting, fitted.used, variance_inflation=fitted.variance_inflation),
        now.trial,
    )


def weighed(now: CrossValidated, record: Won, others: Sequence[InitialCandidate]) -> Won:
    """An explanation with the odds of others in its place, in the model as it is."""
    there = {c.id for c in now.fitted.setting.joined}
    models = [
        (_model(now, [record.trial.candidate.id], [t]), t)
        for t in others
        if t.candidate.id not in there
    ]
    found = [
        (min(odds_of(model, now), 1.0), t)
        for model, t in models
        if not at_an_end(model, t.candidate)
    ]
    found.sort(key=lambda pair: -pair[0])
    return replace(record, others=tuple(t for _, t in found), odds=tuple(o for o, _ in found))
