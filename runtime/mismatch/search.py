"""Steps 1, 3 and 4: add one explanation after the other, as long as each beats its rivals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.mismatch.candidate import TIME, Candidate
from runtime.mismatch.compete import (
    Contestant,
    contest,
    entered,
    free_course_gain,
    placebo_gains,
    shuffled_gains,
)
from runtime.mismatch.fit import Fitted, fit, temper_of
from runtime.mismatch.locate import spot_column
from runtime.mismatch.periods import PENALTY, in_periods
from runtime.mismatch.result import Rival
from runtime.mismatch.rows import Rows
from runtime.mismatch.screen import Trial, screen
from runtime.mismatch.setting import Setting
from runtime.plan import Array

MOST_TERMS = 5
"""Explanations of one recording."""

FINALISTS = 6
"""Trials of each round that are refitted in full."""

PAIRED = 4
"""Trials of which pairs are tried where none alone is worth it."""

NEEDED = 6.0
"""Gain in log likelihood that an explanation needs beyond the logarithm of those tried."""

WORTH = 0.005
"""Gain per settled point that is worth naming: a term of about a tenth of the scatter."""

SURE = 3.0
"""Standard deviations, robust over blocks, by which a gain differs from none."""

RARITY = {"physics": 0.0, "ageing": 0.5, "fault": 1.0, "sensor": 1.5, "free": 3.0}
"""How much less expected each sort is, in log odds [assumed]: laws are simplified more often than
sensors leave their class."""

MOSTLY = 0.7
"""Share of the gain of a course free in time that an effect which only follows time must have."""

SHUFFLES = 20
SEED = 20_240_117
"""Rivals are drawn from one fixed seed, so that the same recording gives the same answer."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Accepted:
    """An explanation that won its round; `others` are those that came next, best first.

    `odds` are theirs against the winner.
    """

    trial: Trial
    gain: float
    rivals: tuple[Rival, ...]
    others: tuple[Trial, ...]
    odds: tuple[float, ...]


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
    plain = contest(_retempered(fit(rows, Setting(), data.open)), None)
    now, tried = plain, 0
    accepted: list[Accepted] = []
    candidates = rows.system.workshop.candidates
    while len(accepted) < MOST_TERMS:
        progress(f"looking for explanation {len(accepted) + 1} among {len(candidates)}")
        step = _round(now, candidates, tried)
        tried += step.tried
        if step.winner is None:
            break
        now = step.winner
        if step.record is not None:
            accepted = [*accepted, step.record]
            now, accepted = _relocated(recut(now), accepted)
        now = contest(_retempered(now.fitted), now.trial)
    return Search(plain, now, tuple(accepted), tried)


def _retempered(fitted: Fitted) -> Fitted:
    """Refitted with neighbours counted as what they are worth by now."""
    temper = temper_of(fitted)
    return fit(fitted.rows, fitted.setting, fitted.used, temper=temper)


@dataclass(frozen=True)
class _Step:
    """A round: the model that won it, if any; no record where a recalibration did."""

    winner: Contestant | None
    record: Accepted | None
    tried: int


def _round(now: Contestant, candidates: Sequence[Candidate], tried: int) -> _Step:
    """The best explanation to add that beats all rivals, if there is one."""
    joined = set(now.fitted.setting.ids)
    free = [c for c in candidates if c.id not in joined]
    trials = screen(now.fitted, free)
    finalists = [entered(now.fitted, t) for t in trials[:FINALISTS]]
    finalists += [entered(now.fitted, t) for t in _coming_and_going(now.fitted, free)]
    ranked = sorted(finalists, key=lambda c: -_net(c, now))
    easing = _released(now, ranked)
    for contestant in ranked:
        trial = contestant.trial
        assert trial is not None
        if easing is not None and not _beats(contestant, easing, now):
            return _Step(easing, None, len(trials))
        rivals = _defeated(contestant, now, easing, tried + len(trials))
        if rivals is not None:
            return _Step(contestant, _recorded(contestant, now, ranked, rivals), len(trials))
    return _Step(None, None, len(trials))


def _recorded(
    winner: Contestant, now: Contestant, ranked: Sequence[Contestant], rivals: tuple[Rival, ...]
) -> Accepted:
    assert winner.trial is not None
    others = [c for c in _instead(winner, ranked) if _net(c, now) > 0]
    return Accepted(
        winner.trial,
        _net(winner, now),
        rivals,
        tuple(c.trial for c in others if c.trial is not None),
        tuple(_odds(c, winner) for c in others),
    )


def _instead(winner: Contestant, ranked: Sequence[Contestant]) -> list[Contestant]:
    """Explanations of the same thing: what they explained is gone once the winner has its place."""
    before = {c.trial.candidate.id: c for c in ranked if c is not winner and c.trial is not None}
    rest = screen(winner.fitted, [c.trial.candidate for c in before.values() if c.trial])
    left = {t.candidate.id: t.gain for t in rest}
    found = []
    for name, contestant in before.items():
        assert contestant.trial is not None
        alone = contestant.trial.gain
        if contestant.trial.course is not None or left.get(name, 0.0) < 0.5 * alone:
            found.append(contestant)
    return found


def _released(now: Contestant, ranked: Sequence[Contestant]) -> Contestant | None:
    """The model with the parameters of the suspected module free; None if that gains nothing."""
    if not ranked or ranked[0].trial is None:
        return None
    module = ranked[0].trial.candidate.module
    setting = now.fitted.setting
    if module in setting.released:
        return None
    freed = replace(setting, released=setting.released | {module})
    easing = contest(
        fit(now.fitted.rows, freed, now.fitted.used, 25, None, now.fitted.temper), now.trial
    )
    return easing if _net(easing, now) > _needed(now, 1) else None


def _beats(contestant: Contestant, easing: Contestant, now: Contestant) -> bool:
    """Is an explanation worth more than letting the calibration go?

    A fault or a sensor error stands beside a calibration that holds, and need only be as good.
    """
    assert contestant.trial is not None
    lead = _net(contestant, now) - _net(easing, now)
    physics = contestant.trial.candidate.sort in ("physics", "ageing")
    return lead > (NEEDED if physics else -NEEDED)


def _needed(now: Contestant, tried: int) -> float:
    """Gain that is worth naming."""
    return NEEDED + float(np.log(max(tried, 1))) + WORTH * now.fitted.rows.groups


def _coming_and_going(fitted: Fitted, candidates: Sequence[Candidate]) -> list[Trial]:
    """Faults as ones that come and go, the more telling first."""
    trials = [in_periods(fitted, c) for c in candidates if c.sort == "fault"]
    found = [t for t in trials if t is not None and t.course is not None]
    return found[:FINALISTS]


def price_of(contestant: Contestant) -> float:
    """What a model costs before any data: rare explanations, and periods of faults.

    Blocks held apart cannot judge periods, so each pays for its ends and its degree.
    """
    setting = contestant.fitted.setting
    periods = sum(len(c.periods) for c in setting.courses)
    each = 0.5 * PENALTY * float(np.log(max(contestant.fitted.rows.groups, 2)))
    return each * periods + sum(RARITY[c.sort] for c in setting.joined)


def _net(contestant: Contestant, now: Contestant) -> float:
    """Gain over a model less the price of what it has more."""
    return contestant.gain_over(now) - price_of(contestant) + price_of(now)


def _odds(other: Contestant, winner: Contestant) -> float:
    """Odds of another explanation against the winner, from their difference over blocks."""
    lead = winner.certainty_over(other)
    certainty = float(np.exp(-0.5 * max(lead, 0.0) ** 2 - 0.8 * max(lead, 0.0)))
    return certainty * float(np.exp(min(price_of(winner) - price_of(other), 0.0)))


def _defeated(
    contestant: Contestant, now: Contestant, easing: Contestant | None, tried: int
) -> tuple[Rival, ...] | None:
    """The rivals with their gains; None where one of them does as well."""
    net = _net(contestant, now)
    if net < _needed(now, tried) or contestant.sureness_over(now) < SURE:
        return None
    trial = contestant.trial
    assert trial is not None
    own, shuffled = shuffled_gains(now.fitted, contestant.fitted, SHUFFLES, SEED)
    placebo = _placebo(now.fitted, trial)
    if trial.course is None and (own <= shuffled.max() or net <= placebo):
        return None
    if set(trial.candidate.drivers.values()) == {TIME}:
        # What only follows the clock explains a course in time, or the driver is another one.
        course = free_course_gain(now.fitted, _columns(now.fitted, trial))
        if trial.gain < MOSTLY * course:
            return None
    return (
        Rival("the plain model, recalibrated", 0.0 if easing is None else _net(easing, now)),
        Rival("as many parameters without physics", placebo),
        Rival("its own course, shuffled by blocks", float(shuffled.max())),
    )


def _placebo(fitted: Fitted, trial: Trial) -> float:
    """Best gain of smooth functions of time at the place of a trial."""
    columns = _columns(fitted, trial)
    if not columns or trial.course is not None:
        return 0.0
    return float(placebo_gains(fitted, trial, columns, SEED).max())


def _columns(fitted: Fitted, trial: Trial) -> list[Array]:
    """Slopes of the residuals by an error at the place of a trial."""
    candidate = trial.candidate
    spots = fitted.rows.system.workshop.spots
    here = [s for s in spots if (s.module, s.place) == (candidate.module, candidate.place)]
    here = here or [s for s in spots if set(s.observers) & set(candidate.observers)][:1]
    return [c for c in (spot_column(fitted, s) for s in here) if c is not None]


def recut(now: Contestant) -> Contestant:
    """Find the periods of faults again, after something else was explained."""
    for course in now.fitted.setting.courses:
        candidate = next(
            c for c in now.fitted.setting.joined if course.unknown in {u.id for u in c.unknowns}
        )
        # A fit without it would be bent by the fault: periods are cut from what the full model
        # leaves without the fault.
        without = fit(
            now.fitted.rows,
            now.fitted.setting.leaving(candidate.id),
            now.fitted.used,
            0,
            None,
            now.fitted.temper,
        )
        trial = in_periods(without, candidate)
        if trial is None:
            continue
        again = entered(without, trial)
        again = replace(again, trial=now.trial)
        if _net(again, now) > 0:
            now = again
    return now


def _relocated(now: Contestant, accepted: list[Accepted]) -> tuple[Contestant, list[Accepted]]:
    """Leave out what later explanations have made needless."""
    for record in accepted[:-1]:
        setting = now.fitted.setting.leaving(record.trial.candidate.id)
        less = contest(
            fit(now.fitted.rows, setting, now.fitted.used, temper=now.fitted.temper), now.trial
        )
        if _net(now, less) < NEEDED:
            now = less
            accepted = [r for r in accepted if r is not record]
    return now, accepted
