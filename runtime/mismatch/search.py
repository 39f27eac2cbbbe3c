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
    placebo_gains,
    refit,
    shuffled_gains,
)
from runtime.mismatch.fit import Fitted, fit, student_weights, temper_of
from runtime.mismatch.hidden import hidden_trials
from runtime.mismatch.locate import spot_column
from runtime.mismatch.periods import STEPS, in_periods
from runtime.mismatch.result import Rival
from runtime.mismatch.rows import Rows
from runtime.mismatch.screen import Trial, screen
from runtime.mismatch.setting import HIDDEN, Setting
from runtime.plan import Array

MOST_TERMS = 7
"""Explanations of one recording."""

FINALISTS = 5
"""Trials of each round that are refitted in full."""

COMING = 4
"""Faults that come and go among them."""

CONTESTED = 4
"""Refitted trials of each round that are judged on blocks they were not fitted to."""

FLICKERING = 2.0
"""How much less expected a sensor is that errs in some periods only, in log odds [assumed]."""

PART = 0.15
"""A hidden driver is told if it gains more than this share of what was explained with a name."""

NEEDED = 6.0
"""Gain in log likelihood that an explanation needs beyond the logarithm of those tried."""

WORTH = 0.005
"""Gain per settled point that is worth naming: a term of about a tenth of the scatter."""

SURE = 3.0
"""Standard deviations, robust over blocks, by which a gain differs from none."""

RARITY = {"physics": 0.0, "ageing": 0.5, "fault": 1.0, "sensor": 1.5, "free": 3.0, "hidden": 0.0}
"""How much less expected each sort is, in log odds [assumed]: laws are simplified more often than
sensors leave their class."""

ALIKE = 0.5
"""Cosine of the changes that two explanations make, from which on they explain the same."""

COMMON = 6.0
"""What a claim about several modules must gain more than one about a single module."""

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
        named = sum(r.gain for r in accepted if r.trial.candidate.sort != HIDDEN)
        step = _round(now, candidates, tried, named)
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


def _round(now: Contestant, candidates: Sequence[Candidate], tried: int, explained: float) -> _Step:
    """The best explanation to add that beats all rivals, if there is one.

    What has a driver that is recorded, or is there all the time, comes first; faults that come and
    go, and drivers that nobody recorded, are free enough to imitate it.
    """
    joined = {c.id for c in now.fitted.setting.joined}
    free = [c for c in candidates if c.id not in joined and not _covered(c, now)]
    trials = screen(now.fitted, free)
    tried += len(trials)
    lasting = _contested([refit(now.fitted, t) for t in trials[:FINALISTS]], now)
    hidden = _hidden(now)
    step = _first(now, lasting, hidden, tried)
    if step is None:
        coming = _coming_and_going(now.fitted, free)
        step = _first(now, _contested([refit(now.fitted, t) for t in coming], now), hidden, tried)
    worth = _needed(now, tried) + PART * explained
    if step is None and hidden is not None and _net(hidden, now) > worth:
        step = _Step(hidden, _recorded(hidden, now, [], ()), 0)
    return replace(step or _Step(None, None, 0), tried=len(trials))


def _covered(candidate: Candidate, now: Contestant) -> bool:
    """Does it only follow the clock where a hidden driver was found? Then it is part of that."""
    hidden = {o for c in now.fitted.setting.joined if c.sort == HIDDEN for o in c.observers}
    by_clock = set(candidate.drivers.values()) == {TIME}
    return by_clock and bool(hidden & set(candidate.observers))


def _first(
    now: Contestant, ranked: Sequence[Contestant], hidden: Contestant | None, tried: int
) -> _Step | None:
    """The first that beats all rivals; or the calibration let go, where that does as well."""
    easing = _released(now, ranked)
    for contestant in ranked:
        if easing is not None and not _beats(contestant, easing, now):
            return _Step(easing, None, 0)
        if hidden is not None and not _as_good(contestant, hidden, now):
            continue
        rivals = _defeated(contestant, now, easing, tried)
        if rivals is not None:
            return _Step(contestant, _recorded(contestant, now, ranked, rivals), 0)
    return None


def _contested(refitted: Sequence[tuple[Fitted, Trial]], now: Contestant) -> list[Contestant]:
    """Those that fit best in the sample, judged on blocks they were not fitted to, best first."""
    by_fit = sorted(refitted, key=lambda f: f[0].objective)
    chosen = [contest(fitted, trial) for fitted, trial in by_fit[:CONTESTED]]
    return sorted(chosen, key=lambda c: -_net(c, now))


def _hidden(now: Contestant) -> Contestant | None:
    """The best course that is free in time at a suspect place."""
    found = [contest(*refit(now.fitted, t)) for t in hidden_trials(now.fitted)]
    return max(found, key=lambda c: _net(c, now), default=None)


def _as_good(contestant: Contestant, hidden: Contestant, now: Contestant) -> bool:
    """Does an explanation do what a course that is free in time would do?

    One whose driver is recorded may leave a part to others. What follows only the clock, or comes
    and goes, is itself no more than a course, and must be the better one.
    """
    trial = contestant.trial
    assert trial is not None
    mere_course = trial.course is not None or set(trial.candidate.drivers.values()) == {TIME}
    return not mere_course or _net(contestant, now) > _net(hidden, now)


def _recorded(
    winner: Contestant, now: Contestant, ranked: Sequence[Contestant], rivals: tuple[Rival, ...]
) -> Accepted:
    assert winner.trial is not None
    others = [c for c in _instead(winner, ranked, now) if _net(c, now) > 0]
    return Accepted(
        winner.trial,
        _net(winner, now),
        rivals,
        tuple(c.trial for c in others if c.trial is not None),
        tuple(_odds(c, winner) for c in others),
    )


def _instead(winner: Contestant, ranked: Sequence[Contestant], now: Contestant) -> list[Contestant]:
    """Explanations of the same thing: they change the residuals alike."""
    rows = now.fitted.rows
    weight = student_weights(rows, now.fitted.residual, now.fitted.scale)
    weight = weight * now.fitted.used[rows.point]

    def change(contestant: Contestant) -> Array:
        return now.fitted.residual - contestant.fitted.residual

    own = change(winner)
    found = []
    for other in ranked:
        course = change(other)
        size = float(np.sqrt(np.sum(weight * own**2) * np.sum(weight * course**2)))
        if other is not winner and float(np.sum(weight * own * course)) > ALIKE * size:
            found.append(other)
    return found


def _released(now: Contestant, ranked: Sequence[Contestant]) -> Contestant | None:
    """The model with the parameters of the suspected module free; None if that gains nothing."""
    if not ranked or ranked[0].trial is None:
        return None
    modules = ranked[0].trial.candidate.modules
    setting = now.fitted.setting
    if setting.released.issuperset(modules):
        return None
    freed = replace(setting, released=setting.released.union(modules))
    easing = contest(
        fit(now.fitted.rows, freed, now.fitted.used, 25, None, now.fitted.temper), now.trial
    )
    return easing if _net(easing, now) > _needed(now, 1) else None


def _let_go(now: Contestant, contestant: Contestant) -> Fitted:
    """The model without an explanation, its calibration let go where the explanation lets it go.

    Under a calibration that holds, a term shows little that base values must make room for.
    """
    fitted, released = now.fitted, contestant.fitted.setting.released
    if released == fitted.setting.released:
        return fitted
    setting = replace(fitted.setting, released=released)
    return fit(fitted.rows, setting, fitted.used, temper=fitted.temper)


def _beats(contestant: Contestant, easing: Contestant, now: Contestant) -> bool:
    """Is an explanation worth more than letting the calibration go?

    A fault or a sensor error stands beside a calibration that holds, and need only be as good.
    """
    assert contestant.trial is not None
    lead = _net(contestant, now) - _net(easing, now)
    physics = contestant.trial.candidate.sort in ("physics", "ageing")
    return lead > (_needed(now, 1) if physics else -NEEDED)


def _needed(now: Contestant, tried: int) -> float:
    """Gain that is worth naming."""
    return NEEDED + float(np.log(max(tried, 1))) + WORTH * now.fitted.rows.groups


def _coming_and_going(fitted: Fitted, candidates: Sequence[Candidate]) -> list[Trial]:
    """Faults as ones that come and go, the more telling first."""
    trials = [in_periods(fitted, c) for c in candidates if c.sort == "fault"]
    found = [t for t in trials if t is not None]
    return sorted(found, key=lambda t: -t.gain)[:COMING]


def price_of(contestant: Contestant) -> float:
    """What a model costs before any data: rare explanations, and periods of faults.

    Blocks held apart cannot judge periods, so each pays for its ends and its degree.
    """
    setting = contestant.fitted.setting
    each = 0.5 * float(np.log(max(contestant.fitted.rows.groups, 2)))
    hidden = {u.id for c in setting.joined if c.sort == HIDDEN for u in c.unknowns}
    steps = sum(STEPS * len(c.periods) for c in setting.courses if c.unknown not in hidden)
    levels = sum(c.levels for c in setting.courses)
    signals = contestant.fitted.rows.system.ruleset.signal_by_id
    rare = sum(RARITY[c.sort] + (COMMON if c.members else 0.0) for c in setting.joined)
    coming = {course.unknown for course in setting.courses}
    for candidate in setting.joined:
        if coming & {u.id for u in candidate.unknowns}:
            rare += FLICKERING * (f"{candidate.module}.{candidate.place}" in signals)
    return each * (steps + levels) + rare


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
    if _at_an_end(contestant):
        return None
    own, shuffled = shuffled_gains(_let_go(now, contestant), contestant.fitted, SHUFFLES, SEED)
    placebo = _placebo(now.fitted, trial)
    if trial.course is None and (own <= shuffled.max() or net <= placebo):
        return None
    return (
        Rival("the plain model, recalibrated", 0.0 if easing is None else _net(easing, now)),
        Rival("as many parameters without physics", placebo),
        Rival("its own course, shuffled by blocks", float(shuffled.max())),
    )


def _at_an_end(contestant: Contestant) -> bool:
    """Did a search run to the end of a range? Then the law fits for another reason."""
    assert contestant.trial is not None
    values = contestant.fitted.setting.values
    for unknown in contestant.trial.candidate.unknowns:
        value = values.get(unknown.id)
        if value is None or value == unknown.null:
            continue
        for end in (unknown.lowest, unknown.highest):
            # A range that begins at the null may be so wide that what is small lies near it.
            if end == unknown.null:
                continue
            if np.isfinite(end) and abs(value - end) <= 1e-6 * (unknown.highest - unknown.lowest):
                return True
    return False


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
        if candidate.sort == HIDDEN:
            continue
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
