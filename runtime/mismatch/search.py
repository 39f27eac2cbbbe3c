"""Steps 1 and 3: add one explanation after the other, as long as each beats its rivals."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.mismatch.accepted import Accepted
from runtime.mismatch.candidate import TIME, Candidate
from runtime.mismatch.coincide import with_settings
from runtime.mismatch.compete import Contestant, contest, cost_of, refit
from runtime.mismatch.exchange import exchanged, weighed
from runtime.mismatch.fit import Fitted, fit
from runtime.mismatch.free_form import best_curve, free_form_trials
from runtime.mismatch.hidden import hidden_trials, with_the_course_of
from runtime.mismatch.pairs import held_pairs, pair_trials
from runtime.mismatch.periods import in_periods
from runtime.mismatch.price import NEEDED, needed, net_gain, odds_of
from runtime.mismatch.result import Rival
from runtime.mismatch.revise import instead, needless, recut, retempered
from runtime.mismatch.rivals import beats, defeated, instead_of, released
from runtime.mismatch.rows import Rows
from runtime.mismatch.screen import Trial, screen
from runtime.mismatch.setting import HIDDEN, Setting

MOST_TERMS = 7
"""Explanations of one recording."""

FINALISTS = 8
"""Trials of each round that are refitted in full."""

HOPELESS = 0.5
"""Share of the gain that is needed below which a trial is not refitted: its gain is estimated to
first order, and seldom doubles."""

COMING = 4
"""Faults that come and go among them."""

CONTESTED = 6
"""Refitted trials of each round that are judged on blocks they were not fitted to."""

CLOSE = 0.01
"""Odds from which on another explanation is asked again after periods were cut anew."""

SURPASSED = 1.35
"""Times the gain of a name that a free curve must gain to say that the name only imitates it."""

DRIVEN = 0.7
"""The same for a fault that comes and goes more than once: if a curve over one reading does nearly
as well, it comes and goes with that reading, and is no fault of its own."""

FEW_CHANGES = 2
"""Periods of a fault that begins, at most."""

COARSE = 0.5
"""Part of that which such a curve must gain on blocks that it was not fitted to."""

PART = 0.15
"""A hidden driver is told if it gains more than this share of what was explained with a name."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Search:
    """What was found: the plain model refitted, the repaired one, and how it came about."""

    plain: Contestant
    best: Contestant
    accepted: tuple[Accepted, ...]
    tried: int


def search(rows: Rows, progress: Progress) -> Search:
    """Find what explains a recording, one explanation at a time."""
    data = rows.system.data
    progress("refitting the plain model")
    plain = contest(retempered(fit(rows, Setting(), data.open)), None)
    named = _one_by_one(plain, plain, (), 0, progress)
    # Several names may together imitate one driver that nobody recorded.
    hidden = _best([refit(plain.fitted, t) for t in hidden_trials(plain.fitted)], plain)
    if hidden is None or any(r.trial.candidate.sort == HIDDEN for r in named.accepted):
        return named
    unnamed = any(r.trial.candidate.sort == "free" for r in named.accepted)
    ahead = net_gain(hidden, plain) - net_gain(named.best, plain)
    if ahead < (0.0 if unnamed else NEEDED):
        return named
    progress("a driver that nobody recorded explains more than all names")
    first = _recorded(hidden, plain, [], ())
    return _one_by_one(plain, hidden, first, named.tried, progress)


def _one_by_one(
    plain: Contestant,
    now: Contestant,
    begun: tuple[Accepted, ...],
    tried: int,
    progress: Progress,
) -> Search:
    """Add explanations to a model, which may have some, until none is worth it."""
    accepted = list(begun)
    candidates = plain.fitted.rows.system.workshop.candidates
    while len(accepted) < MOST_TERMS and not any(
        r.trial.candidate.sort == "free" for r in accepted
    ):
        progress(f"looking for explanation {len(accepted) + 1} among {len(candidates)}")
        named = sum(r.gain for r in accepted if r.trial.candidate.sort != HIDDEN)
        step = _round(now, candidates, tried, named)
        tried = step.tried
        if step.winner is None:
            break
        now = step.winner
        if step.records:
            earlier = [r.trial.candidate.id for r in accepted]
            now, gone = needless(recut(now), earlier)
            accepted = [r for r in accepted if r.trial.candidate.id not in gone]
            now, records = _asked_again(now, step.records)
            paired = len(records) > 1
            if gone or paired:  # weighed beside what is not there any more, or not at all
                finalists = step.finalists if paired else ()
                records = tuple(_weighed(now, r, finalists) for r in records)
            accepted += records
        now = _eased(contest(retempered(now.fitted), now.trial))
    now, found = exchanged(now, accepted)
    return Search(plain, now, found, tried)


def _weighed(now: Contestant, record: Accepted, finalists: Sequence[Trial]) -> Accepted:
    """The odds of others that last, in the model as it is."""
    if record.trial.course is not None or record.trial.candidate.sort in ("free", HIDDEN):
        return record
    lasting = [t for t in record.others if t.course is None][:FINALISTS]
    known = {t.candidate.id for t in lasting}
    return weighed(now, record, [*lasting, *(t for t in finalists if t.candidate.id not in known)])


def _eased(now: Contestant) -> Contestant:
    """The calibration under laws that left something out let go, if that is worth it by now.

    With less left unexplained, a strain on stated values shows that was small before.
    """
    fitted = now.fitted
    physics = [c for c in fitted.setting.joined if c.sort in ("physics", "ageing")]
    modules = fitted.setting.released.union(*(c.modules for c in physics))
    if modules == fitted.setting.released:
        return now
    eased = replace(fitted.setting, released=modules)
    freed = retempered(fit(fitted.rows, eased, fitted.used, temper=fitted.temper))
    held = fit(fitted.rows, fitted.setting, fitted.used, temper=freed.temper)
    return contest(freed, now.trial) if cost_of(freed) < cost_of(held) else now


def _asked_again(
    now: Contestant, records: tuple[Accepted, ...]
) -> tuple[Contestant, tuple[Accepted, ...]]:
    """The winner, or one of those that explain the same, where faults come and go beside it."""
    if len(records) != 1 or not now.fitted.setting.courses or records[0].trial.course is not None:
        return now, records
    record = records[0]
    close = [t for t, o in zip(record.others, record.odds, strict=True) if o > CLOSE]
    lasting = [t for t in close if t.course is None]
    better, name = instead(now, record.trial.candidate.id, lasting)
    if better is now:
        return now, records
    trial = next(t for t in lasting if t.candidate.id == name)
    # The one that had won is now the other, at the odds by which it lost.
    others = (record.trial, *(t for t in record.others if t is not trial))
    kept = [o for t, o in zip(record.others, record.odds, strict=True) if t is not trial]
    swapped = replace(
        record, trial=trial, others=others, odds=(min(odds_of(now, better), 1.0), *kept)
    )
    return better, (swapped,)


@dataclass(frozen=True)
class _Step:
    """A round: the model that won it, if any; no records where a recalibration did.

    `tried` counts all explanations tried so far, `finalists` are the best that were tried alone.
    """

    winner: Contestant | None
    records: tuple[Accepted, ...]
    tried: int
    finalists: tuple[Trial, ...] = ()


def _round(now: Contestant, candidates: Sequence[Candidate], tried: int, explained: float) -> _Step:
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
    hopeless = HOPELESS * needed(now, tried)
    hidden = _best([refit(fitted, t) for t in hidden_trials(fitted)], now)
    # Where no single explanation beats a calibration that is let go, two at once may.
    eased: _Step | None = None
    stages: tuple[Callable[[], list[tuple[Fitted, Trial]]], ...] = (
        lambda: [
            refit(f, t)
            for f, ts in ((fitted, trials), *_held(fitted, free))
            for t in ts[:FINALISTS]
            if t.gain > hopeless
        ],
        lambda: (pair_trials if eased is None else held_pairs)(fitted, trials),
        lambda: [refit(fitted, t) for t in _coming_and_going(fitted, free)],
    )
    for stage in stages:
        ranked = _contested(stage(), now)
        following = [c for c in ranked if _follows_settings(c)]
        hidden = _better(hidden, following[:1], now)
        found = _first(now, [c for c in ranked if c not in following], hidden, tried)
        if found is not None and found.records:
            found = _or_sudden(found, now, fitted, free, hidden)
            found = _or_nameless(found, now) or found
            return replace(found, finalists=tuple(trials[:FINALISTS]))
        eased = eased or found
    if eased is not None:
        return eased
    worth = needed(now, tried) + PART * explained
    unnamed = _contested([refit(fitted, t) for t in free_form_trials(fitted)], now)
    best = _first(now, unnamed, None, tried)
    if hidden is not None and net_gain(hidden, now) > max(worth, _gain_of(best, now)):
        return _Step(hidden, _recorded(hidden, now, [], ()), tried)
    return best or _Step(None, (), tried)


def _held(fitted: Fitted, free: Sequence[Candidate]) -> Iterator[tuple[Fitted, list[Trial]]]:
    """The model with its calibrations held again, and what it then lacks.

    A calibration that was let go makes room for one law, and imitates a second.
    """
    if fitted.setting.released:
        setting = replace(fitted.setting, released=frozenset())
        held = fit(fitted.rows, setting, fitted.used, temper=fitted.temper)
        # Far from what was read a law may have no slope: then it lacks nothing that could be told.
        with contextlib.suppress(np.linalg.LinAlgError):
            yield held, screen(held, free)


def _gain_of(step: _Step | None, now: Contestant) -> float:
    """Net gain of the winner of a step; none without one."""
    return net_gain(step.winner, now) if step is not None and step.winner is not None else 0.0


def _or_nameless(found: _Step, now: Contestant) -> _Step | None:
    """A term without physics, where it explains much more than the best name does.

    A free curve over one reading pays for each piece: laws that hold are explained about as well by
    their names. If the curve is far ahead, the name only imitates what is there.
    """
    if found.winner is None or not found.records:
        return None
    curve, named = best_curve(now.fitted), net_gain(found.winner, now)
    driven = _changes(found.winner) > 1
    share = DRIVEN if driven else SURPASSED
    if curve is None or curve.gain < share * named + NEEDED:
        return None
    unnamed = _contested([refit(now.fitted, t) for t in free_form_trials(now.fitted)], now)
    free = _first(now, unnamed, None, found.tried)
    # A few bands are a coarse curve: on other blocks it does worse than periods cut to measure.
    least = COARSE * share if driven else share
    return free if free is not None and _gain_of(free, now) > least * named else None


def _follows_settings(contestant: Contestant) -> bool:
    """Does a fault come and go with the operating point?"""
    trial = contestant.trial
    if trial is None or trial.course is None:
        return False
    return with_settings(contestant.fitted, trial.course)


def _better(
    hidden: Contestant | None, following: Sequence[Contestant], now: Contestant
) -> Contestant | None:
    """What follows readings in a way that has no name, if that is more than a hidden driver."""
    trials = (with_the_course_of(now.fitted, c.trial) for c in following if c.trial is not None)
    found = [contest(*refit(now.fitted, t)) for t in trials if t is not None]
    known = [*found, *([hidden] if hidden is not None else [])]
    return max(known, key=lambda c: net_gain(c, now), default=None)


def _changes(contestant: Contestant) -> int:
    """Periods of what was added, if it comes and goes."""
    trial = contestant.trial
    return 0 if trial is None or trial.course is None else len(trial.course.periods)


def _or_sudden(
    found: _Step,
    now: Contestant,
    fitted: Fitted,
    candidates: Sequence[Candidate],
    hidden: Contestant | None,
) -> _Step:
    """A fault that begins, where that says the same better than what lasts: a driver may happen to
    turn about when the fault began."""
    winner = found.winner
    trial = None if winner is None else winner.trial
    if trial is None or winner is None or not found.records or trial.course is not None:
        return found
    sudden = _contested([refit(fitted, t) for t in _coming_and_going(fitted, candidates)], now)
    alike = instead_of(winner, sudden, now)
    sudden = [c for c in alike if _changes(c) <= FEW_CHANGES]
    better = _first(now, sudden, hidden, found.tried)
    if better is None or better.winner is None or not better.records:
        return found
    return better if net_gain(better.winner, now) > net_gain(winner, now) else found


def _covered(candidate: Candidate, now: Contestant) -> bool:
    """Does it only follow the clock where a hidden driver was found? Then it is part of that."""
    hidden = {o for c in now.fitted.setting.joined if c.sort == HIDDEN for o in c.observers}
    by_clock = set(candidate.drivers.values()) == {TIME}
    return by_clock and bool(hidden & set(candidate.observers))


def _first(
    now: Contestant, ranked: Sequence[Contestant], hidden: Contestant | None, tried: int
) -> _Step | None:
    """The first that beats all rivals; or the calibration let go, where that does as well."""
    easing = released(now, ranked)
    for contestant in ranked:
        if easing is not None and not beats(contestant, easing, now):
            return _Step(easing, (), tried)
        if hidden is not None and not _as_good(contestant, hidden, now):
            continue
        rivals = defeated(contestant, now, easing, tried)
        if rivals is None:
            continue
        # Of those that explain the same, the most probable: the first may lead by next to nothing.
        for other in instead_of(contestant, ranked, now):
            lost = defeated(other, now, easing, tried)
            if lost is not None and odds_of(other, contestant) > 1.0:
                contestant, rivals = other, lost
        return _Step(contestant, _recorded(contestant, now, ranked, rivals), tried)
    return None


def _contested(refitted: Sequence[tuple[Fitted, Trial]], now: Contestant) -> list[Contestant]:
    """Those that fit best in the sample, judged on blocks they were not fitted to, best first."""
    by_fit = sorted(refitted, key=lambda f: cost_of(f[0]))
    chosen = [contest(fitted, trial) for fitted, trial in by_fit[:CONTESTED]]
    return sorted(chosen, key=lambda c: -net_gain(c, now))


def _best(refitted: Sequence[tuple[Fitted, Trial]], now: Contestant) -> Contestant | None:
    return max((contest(*r) for r in refitted), key=lambda c: net_gain(c, now), default=None)


def _as_good(contestant: Contestant, hidden: Contestant, now: Contestant) -> bool:
    """Does an explanation do what a course that is free in time would do?

    One whose driver is recorded may leave a part to others. What follows only the clock, or comes
    and goes, is itself no more than a course, and must be the better one.
    """
    trial = contestant.trial
    assert trial is not None
    mere_course = trial.course is not None or set(trial.candidate.drivers.values()) == {TIME}
    return not mere_course or net_gain(contestant, now) > net_gain(hidden, now)


def _recorded(
    winner: Contestant, now: Contestant, ranked: Sequence[Contestant], rivals: tuple[Rival, ...]
) -> tuple[Accepted, ...]:
    """What was accepted; two records where two explanations were needed at once."""
    assert winner.trial is not None
    others = [c for c in instead_of(winner, ranked, now) if net_gain(c, now) > 0]
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


def _in_place_of(trial: Trial, ours: set[str], other: Contestant) -> Trial | None:
    """What another model has instead of an explanation; None if it has the same.

    `ours` are the ids of all that was found together.
    """
    assert other.trial is not None
    theirs = (other.trial, *other.trial.along)
    if trial.candidate.id in {t.candidate.id for t in theirs}:
        return None
    return next((t for t in theirs if t.candidate.id not in ours), other.trial)


def _coming_and_going(fitted: Fitted, candidates: Sequence[Candidate]) -> list[Trial]:
    """Faults as ones that come and go, the more telling first."""
    trials = [in_periods(fitted, c) for c in candidates if c.sort == "fault"]
    found = [t for t in trials if t is not None]
    return sorted(found, key=lambda t: -t.gain)[:COMING]
