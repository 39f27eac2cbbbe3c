"""Steps 1, 3 and 4: add one explanation after the other, as long as each beats its rivals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.mismatch.candidate import Candidate
from runtime.mismatch.compete import (
    Contestant,
    contest,
    entered,
    placebo_gains,
    shuffled_gains,
)
from runtime.mismatch.fit import Fitted, fit
from runtime.mismatch.locate import spot_column
from runtime.mismatch.periods import PENALTY, in_periods
from runtime.mismatch.result import Rival
from runtime.mismatch.rows import Rows
from runtime.mismatch.screen import Trial, screen
from runtime.mismatch.setting import Setting

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
    plain = contest(fit(rows, Setting(), data.open), None)
    now, tried = plain, 0
    accepted: list[Accepted] = []
    candidates = rows.system.workshop.candidates
    for number in range(MOST_TERMS):
        progress(f"looking for explanation {number + 1} among {len(candidates)}")
        found, count = _round(now, candidates, tried)
        tried += count
        if found is None:
            break
        winner, record = found
        now, accepted = winner, [*accepted, record]
        now = recut(now)
        now, accepted = _relocated(now, accepted)
    return Search(plain, now, tuple(accepted), tried)


def _round(
    now: Contestant, candidates: Sequence[Candidate], tried: int
) -> tuple[tuple[Contestant, Accepted] | None, int]:
    """The best explanation to add that beats all rivals, if there is one."""
    joined = set(now.fitted.setting.ids)
    free = [c for c in candidates if c.id not in joined]
    trials = screen(now.fitted, free)
    count = len(trials)
    finalists = [entered(now.fitted, t) for t in trials[:FINALISTS]]
    finalists += [entered(now.fitted, t) for t in _coming_and_going(now.fitted, free)]
    ranked = sorted(finalists, key=lambda c: -_net(c, now))
    for contestant in ranked:
        rivals = _defeated(contestant, now, tried + count)
        if rivals is not None:
            others = [c for c in ranked if c is not contestant and _net(c, now) > 0]
            odds = tuple(_odds(c, contestant) for c in others)
            trial = contestant.trial
            assert trial is not None
            record = Accepted(
                trial,
                _net(contestant, now),
                rivals,
                tuple(c.trial for c in others if c.trial is not None),
                odds,
            )
            return (contestant, record), count
    return None, count


def _coming_and_going(fitted: Fitted, candidates: Sequence[Candidate]) -> list[Trial]:
    """Faults as ones that come and go, the more telling first."""
    trials = [in_periods(fitted, c) for c in candidates if c.sort == "fault"]
    found = [t for t in trials if t is not None and t.course is not None]
    return found[:FINALISTS]


def price_of(contestant: Contestant) -> float:
    """What the periods of faults cost: blocks held apart cannot judge them."""
    periods = sum(len(c.periods) for c in contestant.fitted.setting.courses)
    return 0.5 * PENALTY * float(np.log(max(contestant.fitted.rows.groups, 2))) * periods


def _net(contestant: Contestant, now: Contestant) -> float:
    """Gain over a model less the price of periods that it has more."""
    return contestant.gain_over(now) - price_of(contestant) + price_of(now)


def _odds(other: Contestant, winner: Contestant) -> float:
    """Odds of another explanation against the winner, from their difference over blocks."""
    lead = winner.certainty_over(other) + 0.25 * (price_of(other) - price_of(winner))
    return float(np.exp(-0.5 * max(lead, 0.0) ** 2 - 0.8 * max(lead, 0.0)))


def _defeated(contestant: Contestant, now: Contestant, tried: int) -> tuple[Rival, ...] | None:
    """The rivals with their gains; None where one of them does as well."""
    net = _net(contestant, now)
    groups = contestant.fitted.rows.groups
    if net < NEEDED + np.log(max(tried, 1)) + WORTH * groups:
        return None
    if contestant.sureness_over(now) < SURE:
        return None
    trial = contestant.trial
    assert trial is not None
    own, shuffled = shuffled_gains(now.fitted, contestant.fitted, SHUFFLES, SEED)
    placebo = _placebo(now.fitted, trial)
    if trial.course is None and (own <= shuffled.max() or net <= placebo):
        return None
    return (
        Rival("the plain model, recalibrated", 0.0),
        Rival("as many parameters without physics", placebo),
        Rival("its own course, shuffled by blocks", float(shuffled.max())),
    )


def _placebo(fitted: Fitted, trial: Trial) -> float:
    """Best gain of smooth functions of time at the place of a trial."""
    candidate = trial.candidate
    spots = fitted.rows.system.workshop.spots
    here = [s for s in spots if (s.module, s.place) == (candidate.module, candidate.place)]
    here = here or [s for s in spots if set(s.observers) & set(candidate.observers)][:1]
    columns = [c for c in (spot_column(fitted, s) for s in here) if c is not None]
    if not columns or trial.course is not None:
        return 0.0
    return float(placebo_gains(fitted, trial, columns, SEED).max())


def recut(now: Contestant) -> Contestant:
    """Find the periods of faults again, after something else was explained."""
    for course in now.fitted.setting.courses:
        candidate = next(
            c for c in now.fitted.setting.joined if course.unknown in {u.id for u in c.unknowns}
        )
        rest = fit(now.fitted.rows, now.fitted.setting.leaving(candidate.id), now.fitted.used)
        # The fit without it is bent by the fault: periods are cut from what the full model leaves.
        bare = replace(rest, setting=rest.setting)
        trial = in_periods(_eased(now.fitted, candidate.id, bare), candidate)
        if trial is None:
            continue
        again = entered(_eased(now.fitted, candidate.id, bare), trial)
        again = replace(again, trial=now.trial)
        if _net(again, now) > 0:
            now = again
    return now


def _eased(full: Fitted, candidate: str, without: Fitted) -> Fitted:
    """The fit without a fault, at the base values of the fit with it."""
    values = {n: full.setting.values.get(n, v) for n, v in without.setting.values.items()}
    setting = replace(without.setting, values=values)
    return fit(full.rows, setting, full.used, steps=0)


def _relocated(now: Contestant, accepted: list[Accepted]) -> tuple[Contestant, list[Accepted]]:
    """Leave out what later explanations have made needless."""
    for record in accepted[:-1]:
        setting = now.fitted.setting.leaving(record.trial.candidate.id)
        less = contest(fit(now.fitted.rows, setting, now.fitted.used), now.trial)
        if _net(now, less) < NEEDED:
            now = less
            accepted = [r for r in accepted if r is not record]
    return now, accepted
