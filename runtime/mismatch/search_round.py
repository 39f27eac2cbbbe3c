"""One round of the search: the best explanation to add that beats all rivals, if there is one."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.mismatch.accepted import Accepted
from runtime.mismatch.candidate import TIME, Candidate
from runtime.mismatch.coincide import with_settings
from runtime.mismatch.compete import Contestant, contest, cost_of, refit
from runtime.mismatch.fit import Fitted, fit
from runtime.mismatch.free_form import best_curve, free_form_trials
from runtime.mismatch.hidden import hidden_trials, with_the_course_of
from runtime.mismatch.pairs import TRIED, held_pairs, pair_trials, torn_pairs
from runtime.mismatch.periods import in_periods
from runtime.mismatch.price import (
    NEEDED,
    SURPASSED,
    gain_in_sample,
    needed,
    net_gain,
    odds_of,
)
from runtime.mismatch.result import Rival
from runtime.mismatch.rivals import at_an_end, beats, defeated, instead_of, released
from runtime.mismatch.screen import Trial, screen
from runtime.mismatch.setting import HIDDEN

FINALISTS = 8
"""Trials of each round that are refitted in full."""

HOPELESS = 0.5
"""Share of the gain that is needed, or to be beaten, below which a trial is not refitted: its gain
is estimated to first order, and seldom doubles."""

COMING = 4
"""Faults that come and go among them."""

CONTESTED = 6
"""Refitted trials of each round that are judged on blocks they were not fitted to."""

DRIVEN = 0.7
"""The same for a fault that comes and goes more than once: if a curve over one reading does nearly
as well, it comes and goes with that reading, and is no fault of its own."""

FEW_CHANGES = 2
"""Periods of a fault that begins, at most."""

COARSE = 0.5
"""Part of that which such a curve must gain on blocks that it was not fitted to."""

EVEN = 1.5
"""Odds up to which two are told apart by blocks that they were not fitted to."""

PART = 0.15
"""What has no name is told if it gains more than this share of what was explained with a name."""


Refit = tuple[Fitted, Trial]
"""A model refitted with a trial in it."""


@dataclass(frozen=True)
class Step:
    """A round: the model that won it, if any; no records where a recalibration did.

    `tried` counts all explanations tried so far, `finalists` are the best that were tried alone.
    """

    winner: Contestant | None
    records: tuple[Accepted, ...]
    tried: int
    finalists: tuple[Trial, ...] = ()


def best_step(
    now: Contestant, candidates: Sequence[Candidate], tried: int, explained: float
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
    torn: list[Contestant] = []
    # Of pairs whose parts hide each other all are looked at, and that is paid for.
    pairs = tried + len(trials) * (len(trials) - 1) // 2
    stages: tuple[tuple[int, Callable[[], list[Refit]]], ...] = (
        (tried, lambda: _singles(fitted, trials, free, HOPELESS * needed(now, tried))),
        (
            pairs,
            lambda: (
                pair_trials(fitted, trials, HOPELESS * needed(now, pairs))
                if eased is None
                else held_pairs(fitted, trials)
            ),
        ),
        (tried, lambda: [refit(fitted, t) for t in _coming_and_going(fitted, free)]),
        (tried, lambda: torn_pairs(fitted, _alone(torn), lambda begun: _seconds(begun, free))),
    )
    for count, refits in stages:
        ranked = _contested(refits(), now)
        following = _following(ranked, now)
        hidden = _better(hidden, following[:1], now)
        apart = [c for c in ranked if c not in following and _is_more(c, torn, now)]
        found = _first(now, apart, hidden, count)
        if found is not None and found.records:
            found = _challenged(replace(found, tried=tried), now, ranked, free, hidden)
            return replace(found, finalists=tuple(trials[:FINALISTS]))
        # A pair that loses against a calibration that is let go says nothing of a single one.
        eased = eased or (found if refits is not stages[-1][1] else None)
        torn += [c for c in ranked if net_gain(c, now) > needed(now, tried)]
    if eased is not None:
        return eased
    worth = needed(now, tried) + PART * explained
    unnamed = _contested([refit(fitted, t) for t in free_form_trials(fitted)], now)
    best = _first(now, unnamed, None, tried)
    # What names left over by a small part may be the shape of one of them.
    if best is not None and _gain_of(best, now) < PART * explained:
        best = None
    if hidden is not None and net_gain(hidden, now) > max(worth, _gain_of(best, now)):
        return Step(hidden, recorded(hidden, now, [], ()), tried)
    return best or Step(None, (), tried)


def _singles(
    fitted: Fitted, trials: Sequence[Trial], free: Sequence[Candidate], least: float
) -> list[Refit]:
    """Refits with one explanation, also with calibrations held that were let go."""
    ways = ((fitted, trials), *_held(fitted, free))
    return [refit(f, t) for f, ts in ways for t in ts[:FINALISTS] if t.gain > least]


def _challenged(
    found: Step,
    now: Contestant,
    ranked: Sequence[Contestant],
    free: Sequence[Candidate],
    hidden: Contestant | None,
) -> Step:
    """What was found, unless something freer says more, or two names more than that."""
    other = _or_sudden(found, now, free, hidden)
    other = _or_nameless(other, now) or other
    if other.winner is found.winner:
        return found
    return _or_both(other, now, ranked, free, hidden)


def _is_more(contestant: Contestant, torn: Sequence[Contestant], now: Contestant) -> bool:
    """Does a pair gain more than a single explanation that does not win?

    Two small ones may be sure of what they gain; what is large and torn needs another second.
    """
    if contestant.trial is None or not contestant.trial.along:
        return True
    single = max((net_gain(c, now) for c in torn if not _runs_out(c)), default=-np.inf)
    return net_gain(contestant, now) > single


def _alone(torn: Sequence[Contestant]) -> list[Refit]:
    """Single explanations, as they were refitted, the best in the sample first.

    What comes and goes more often imitates anything, and all the more beside another.
    """
    each = [(c.fitted, c.trial) for c in torn if c.trial is not None and not c.trial.along]
    single = [(fitted, trial) for fitted, trial in each if _periods(trial) <= FEW_CHANGES]
    return sorted(single, key=lambda s: cost_of(s[0]))


def _seconds(begun: Fitted, free: Sequence[Candidate]) -> list[Trial]:
    """What may stand beside an explanation that is there already: what lasts, and what begins."""
    joined = {c.id for c in begun.setting.joined}
    rest = [c for c in free if c.id not in joined]
    # Far from what was read a law may have no slope: then it lacks nothing that could be told.
    with contextlib.suppress(np.linalg.LinAlgError):
        return [*screen(begun, rest)[:TRIED], *_coming_and_going(begun, rest, FEW_CHANGES)[:TRIED]]
    return []


def _held(fitted: Fitted, free: Sequence[Candidate]) -> Iterator[tuple[Fitted, list[Trial]]]:
    """The model with its calibrations held again, and what it then lacks.

    A calibration that was let go makes room for one law, and imitates a second.
    """
    if fitted.setting.released:
        setting = fitted.setting.calibrated()
        held = fit(fitted.rows, setting, fitted.used, temper=fitted.temper)
        with contextlib.suppress(np.linalg.LinAlgError):  # as in `_seconds`
            yield held, screen(held, free)


def _gain_of(step: Step | None, now: Contestant) -> float:
    """Net gain of the winner of a step; none without one."""
    return net_gain(step.winner, now) if step is not None and step.winner is not None else 0.0


def _or_nameless(found: Step, now: Contestant) -> Step | None:
    """A term without physics, where it explains much more than the best name does.

    A free curve over one reading pays for each piece: laws that hold are explained about as well by
    their names. If the curve is far ahead, the name only imitates what is there.
    """
    if found.winner is None or not found.records:
        return None
    curve, named = best_curve(now.fitted), net_gain(found.winner, now)
    driven = found.winner.trial is not None and _periods(found.winner.trial) > 1
    share = DRIVEN if driven else SURPASSED
    if curve is None or curve.gain < share * named + NEEDED:
        return None
    unnamed = _contested([refit(now.fitted, t) for t in free_form_trials(now.fitted)], now)
    free = _first(now, unnamed, None, found.tried)
    # A few bands are a coarse curve: on other blocks it does worse than periods cut to measure.
    least = COARSE * share if driven else share
    return free if free is not None and _gain_of(free, now) > least * named else None


def _or_both(
    found: Step,
    now: Contestant,
    ranked: Sequence[Contestant],
    free: Sequence[Candidate],
    hidden: Contestant | None,
) -> Step:
    """Two names at once, where a single one was found and gave way to what is freer.

    Of two laws that are left out, one alone does not do well everywhere: a fault that begins or a
    curve then does better than it, and worse than both.
    """
    pairs = torn_pairs(now.fitted, _alone(ranked), lambda begun: _seconds(begun, free))
    both = _first(now, _contested(pairs, now), hidden, found.tried)
    ahead = _gain_of(both, now) > _gain_of(found, now) + NEEDED
    return both if both is not None and both.records and ahead else found


def _following(ranked: Sequence[Contestant], now: Contestant) -> list[Contestant]:
    """Faults that come and go with the operating point, and others that do the same, less well."""
    coming = [c for c in ranked if c.trial is not None and c.trial.course is not None]
    found = [c for c in coming if c.trial is not None and with_settings(now.fitted, c.trial)]
    if not found:
        return []
    alike = instead_of(found[0], coming, now)
    least = net_gain(found[0], now)
    return [*found, *(c for c in alike if c not in found and net_gain(c, now) < least)]


def _better(
    hidden: Contestant | None, following: Sequence[Contestant], now: Contestant
) -> Contestant | None:
    """What follows readings in a way that has no name, if that is more than a hidden driver."""
    trials = (with_the_course_of(now.fitted, c.trial) for c in following if c.trial is not None)
    found = [contest(*refit(now.fitted, t)) for t in trials if t is not None]
    known = [*found, *([hidden] if hidden is not None else [])]
    return max(known, key=lambda c: net_gain(c, now), default=None)


def _periods(trial: Trial) -> int:
    """Periods of what comes and goes; 0 of what lasts."""
    return 0 if trial.course is None else len(trial.course.periods)


def _or_sudden(
    found: Step, now: Contestant, candidates: Sequence[Candidate], hidden: Contestant | None
) -> Step:
    """A fault that begins, where that says more than what lasts, and leaves nothing of it: a driver
    may happen to turn about when the fault began, and what is left of a fault can look like a law.
    """
    fitted, winner = now.fitted, found.winner
    trial = None if winner is None else winner.trial
    if trial is None or winner is None or not found.records or trial.course is not None:
        return found
    hopeless = HOPELESS * net_gain(winner, now)
    coming = _coming_and_going(fitted, candidates)
    begun = [t for t in coming if _periods(t) <= FEW_CHANGES and t.gain > hopeless]
    sudden = _contested([refit(fitted, t) for t in begun], now)
    better = _first(now, sudden, hidden, found.tried)
    if better is None or better.winner is None or not better.records:
        return found
    if net_gain(better.winner, now) <= net_gain(winner, now):
        return found
    beside = contest(*refit(better.winner.fitted, trial))
    left = gain_in_sample(beside, better.winner)
    return found if left > needed(better.winner, better.tried) else better


def _covered(candidate: Candidate, now: Contestant) -> bool:
    """Does it only follow the clock where a hidden driver was found? Then it is part of that."""
    hidden = {o for c in now.fitted.setting.joined if c.sort == HIDDEN for o in c.observers}
    by_clock = set(candidate.drivers.values()) == {TIME}
    return by_clock and bool(hidden & set(candidate.observers))


def _first(
    now: Contestant, ranked: Sequence[Contestant], hidden: Contestant | None, tried: int
) -> Step | None:
    """The first that beats all rivals; or the calibration let go, where that does as well."""
    easing = released(now, ranked)
    for contestant in ranked:
        if easing is not None and not beats(contestant, easing, now):
            return Step(easing, (), tried)
        if hidden is not None and not _as_good(contestant, hidden, now):
            continue
        rivals = defeated(contestant, now, easing, tried)
        if rivals is None:
            continue
        # Of those that explain the same, the most probable: the first may lead by next to nothing.
        for other in instead_of(contestant, ranked, now):
            lost = defeated(other, now, easing, tried)
            if lost is not None and odds_of(other, contestant) > EVEN:
                contestant, rivals = other, lost
        return Step(contestant, recorded(contestant, now, ranked, rivals), tried)
    return None


def _contested(refitted: Sequence[Refit], now: Contestant) -> list[Contestant]:
    """Those that fit best in the sample, judged on blocks they were not fitted to, best first."""
    by_fit = sorted(refitted, key=lambda f: cost_of(f[0]))
    chosen = [contest(fitted, trial) for fitted, trial in by_fit[:CONTESTED]]
    return sorted(chosen, key=lambda c: -net_gain(c, now))


def best_of(refitted: Sequence[Refit], now: Contestant) -> Contestant | None:
    return max((contest(*r) for r in refitted), key=lambda c: net_gain(c, now), default=None)


def _as_good(contestant: Contestant, hidden: Contestant, now: Contestant) -> bool:
    """Does an explanation do what a course that is free in time would do?

    One whose driver is recorded may leave a part to others. What follows only the clock, or comes
    and goes, is itself no more than a course, and must be the better one.
    """
    trial = contestant.trial
    assert trial is not None
    comes_and_goes = any(t.course is not None for t in (trial, *trial.along))
    if not comes_and_goes and TIME not in trial.candidate.drivers.values():
        return True
    return gain_in_sample(contestant, now) > gain_in_sample(hidden, now)


def recorded(
    winner: Contestant, now: Contestant, ranked: Sequence[Contestant], rivals: tuple[Rival, ...]
) -> tuple[Accepted, ...]:
    """What was accepted; two records where two explanations were needed at once."""
    assert winner.trial is not None
    alike = instead_of(winner, ranked, now)
    others = [c for c in alike if net_gain(c, now) > 0 and not _runs_out(c)]
    trials = (winner.trial, *winner.trial.along)
    ours = {t.candidate.id for t in trials}
    records = []
    for trial in trials:
        kept: dict[str, tuple[Trial, float]] = {}
        for other in others:
            instead_ = _in_place_of(trial, ours, other)
            if instead_ is not None and instead_.candidate.id not in kept:
                kept[instead_.candidate.id] = (instead_, min(odds_of(other, winner), 1.0))
        gain = net_gain(winner, now) / len(trials)
        rest = tuple(kept.values())
        records.append(
            Accepted(trial, gain, rivals, tuple(t for t, _ in rest), tuple(o for _, o in rest))
        )
    return tuple(records)


def _runs_out(contestant: Contestant) -> bool:
    """Is a law of it at an end of its range? It lost, whatever it gains."""
    trial = contestant.trial
    return trial is not None and at_an_end(
        contestant, *(t.candidate for t in (trial, *trial.along))
    )


def _in_place_of(trial: Trial, ours: set[str], other: Contestant) -> Trial | None:
    """What another model has instead of an explanation; None if it has the same.

    `ours` are the ids of all that was found together.
    """
    assert other.trial is not None
    theirs = (other.trial, *other.trial.along)
    if trial.candidate.id in {t.candidate.id for t in theirs}:
        return None
    return next((t for t in theirs if t.candidate.id not in ours), other.trial)


def _coming_and_going(
    fitted: Fitted, candidates: Sequence[Candidate], most: float = np.inf
) -> list[Trial]:
    """Faults as ones that come and go, in so many periods at most, the more telling first."""
    trials = [in_periods(fitted, c, most) for c in candidates if c.sort == "fault"]
    found = [t for t in trials if t is not None]
    return sorted(found, key=lambda t: -t.gain)[:COMING]
