"""One round of the search: the best explanation to add that beats all rivals, if there is one."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from rulec.effects.candidate import TIME, Candidate
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.configuration import HIDDEN
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.screen import InitialCandidate, screen
from rulec.mismatch.search.challenge import challenged
from rulec.mismatch.search.coincide import with_settings
from rulec.mismatch.search.compete import CrossValidated, Refit, contest, refit
from rulec.mismatch.search.free_form import free_form_trials
from rulec.mismatch.search.latent_input import hidden_trials, with_the_course_of
from rulec.mismatch.search.pairs import held_pairs, pair_trials, torn_pairs
from rulec.mismatch.search.periods import coming_and_going
from rulec.mismatch.search.rivals import instead_of
from rulec.mismatch.search.weigh import needed, net_gain
from rulec.mismatch.search.winner import (
    Step,
    best_of,
    contested,
    first_to_win,
    gain_of,
    recorded,
    runs_out,
)


def best_step(
    now: CrossValidated, candidates: Sequence[Candidate], tried: int, explained: float
) -> Step:
    """The best explanation to add that beats all rivals, if there is one.

    What has a driver that is recorded, or is there all the time, comes first, then two such at
    once; faults that come and go, drivers that nobody recorded, and terms without physics are free
    enough to imitate it.
    """
    fitted = now.fitted
    joined = {c.id for c in fitted.setting.joined}
    free = [c for c in candidates if c.id not in joined and not _covered(c, now)]
    trials = screen(fitted, free)
    tried += len(trials)
    hidden = best_of([refit(fitted, t) for t in hidden_trials(fitted)], now)
    # Where no single explanation beats a calibration that is let go, two at once may.
    eased: Step | None = None
    # And where one is worth enough and yet loses: it may make up for two, not well everywhere.
    torn: list[CrossValidated] = []
    # Of pairs whose parts hide each other all are looked at, and that is paid for.
    pairs = tried + len(trials) * (len(trials) - 1) // 2
    stages: tuple[tuple[int, Callable[[], list[Refit]]], ...] = (
        (tried, lambda: _singles(fitted, trials, free, limits.HOPELESS * needed(now, tried))),
        (
            pairs,
            lambda: (
                pair_trials(fitted, trials, limits.HOPELESS * needed(now, pairs))
                if eased is None
                else held_pairs(fitted, trials)
            ),
        ),
        (tried, lambda: [refit(fitted, t) for t in coming_and_going(fitted, free)]),
        (tried, lambda: torn_pairs(fitted, torn, free)),
    )
    for count, refits in stages:
        ranked = contested(refits(), now)
        following = _following(ranked, now)
        hidden = _better(hidden, following[:1], now)
        apart = [c for c in ranked if c not in following and _is_more(c, torn, now)]
        found = first_to_win(now, apart, hidden, count)
        if found is not None and found.records:
            found = challenged(replace(found, tried=tried), now, ranked, free, hidden)
            return replace(found, finalists=tuple(trials[: limits.FINALISTS]))
        # A pair that loses against a calibration that is let go says nothing of a single one.
        eased = eased or (found if refits is not stages[-1][1] else None)
        torn += [c for c in ranked if net_gain(c, now) > needed(now, tried)]
    if eased is not None:
        return eased
    worth = needed(now, tried) + limits.UNNAMED_PART * explained
    unnamed = contested([refit(fitted, t) for t in free_form_trials(fitted)], now)
    best = first_to_win(now, unnamed, None, tried)
    # What names left over by a small part may be the shape of one of them.
    if best is not None and gain_of(best, now) < limits.UNNAMED_PART * explained:
        best = None
    if hidden is not None and net_gain(hidden, now) > max(worth, gain_of(best, now)):
        return Step(hidden, recorded(hidden, now, [], ()), tried)
    return best or Step(None, (), tried)


def _singles(
    fitted: Fitted, trials: Sequence[InitialCandidate], free: Sequence[Candidate], least: float
) -> list[Refit]:
    """Refits with one explanation, also with calibrations held that were let go."""
    ways = ((fitted, trials), *_held(fitted, free))
    return [refit(f, t) for f, ts in ways for t in ts[: limits.FINALISTS] if t.gain > least]


def _is_more(
    contestant: CrossValidated, torn: Sequence[CrossValidated], now: CrossValidated
) -> bool:
    """Does a pair gain more than a single explanation that does not win?

    Two small ones may be sure of what they gain; what is large and torn needs another second.
    """
    if contestant.trial is None or not contestant.trial.along:
        return True
    single = max((net_gain(c, now) for c in torn if not runs_out(c)), default=-np.inf)
    return net_gain(contestant, now) > single


def _held(
    fitted: Fitted, free: Sequence[Candidate]
) -> Iterator[tuple[Fitted, list[InitialCandidate]]]:
    """The model with its calibrations held again, and what it then lacks.

    A calibration that was let go makes room for one law, and imitates a second.
    """
    if fitted.setting.released:
        setting = fitted.setting.calibrated()
        held = fit(fitted.rows, setting, fitted.used, variance_inflation=fitted.variance_inflation)
        with contextlib.suppress(np.linalg.LinAlgError):  # far from what was read
            yield held, screen(held, free)


def _following(ranked: Sequence[CrossValidated], now: CrossValidated) -> list[CrossValidated]:
    """Faults that come and go with the operating point, and others that do the same, less well."""
    coming = [c for c in ranked if c.trial is not None and c.trial.course is not None]
    found = [c for c in coming if c.trial is not None and with_settings(now.fitted, c.trial)]
    if not found:
        return []
    alike = instead_of(found[0], coming, now)
    least = net_gain(found[0], now)
    return [*found, *(c for c in alike if c not in found and net_gain(c, now) < least)]


def _better(
    hidden: CrossValidated | None, following: Sequence[CrossValidated], now: CrossValidated
) -> CrossValidated | None:
    """What follows readings in a way that has no name, if that is more than a hidden driver."""
    trials = (with_the_course_of(now.fitted, c.trial) for c in following if c.trial is not None)
    found = [contest(*refit(now.fitted, t)) for t in trials if t is not None]
    known = [*found, *([hidden] if hidden is not None else [])]
    return max(known, key=lambda c: net_gain(c, now), default=None)


def _covered(candidate: Candidate, now: CrossValidated) -> bool:
    """Does it only follow the clock where a hidden driver was found? Then it is part of that."""
    hidden = {o for c in now.fitted.setting.joined if c.sort == HIDDEN for o in c.observers}
    by_clock = set(candidate.drivers.values()) == {TIME}
    return by_clock and bool(hidden & set(candidate.observers))
