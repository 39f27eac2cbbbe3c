"""Looking back: what an explanation means for those accepted before it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.configuration import HIDDEN
from rulec.mismatch.evidence.steady.fit import Fitted, fit, variance_inflation_of
from rulec.mismatch.evidence.steady.screen import InitialCandidate
from rulec.mismatch.search.compete import CrossValidated, contest, entered
from rulec.mismatch.search.periods import in_periods
from rulec.mismatch.search.rivals import at_an_end
from rulec.mismatch.search.weigh import net_gain, odds_of


def retempered(fitted: Fitted) -> Fitted:
    """Refitted with neighbours counted as what they are worth by now."""
    variance_inflation = variance_inflation_of(fitted)
    return fit(fitted.rows, fitted.setting, fitted.used, variance_inflation=variance_inflation)


def recut(now: CrossValidated) -> CrossValidated:
    """Find the periods of faults again, after something else was explained."""
    for course in now.fitted.setting.courses:
        candidate = now.fitted.setting.candidate_of(course)
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
            now.fitted.variance_inflation,
        )
        trial = in_periods(without, candidate)
        if trial is None:
            continue
        again = entered(without, trial)
        again = replace(again, trial=now.trial)
        if net_gain(again, now) > 0:
            now = again
    return now


def needless(now: CrossValidated, names: list[str]) -> tuple[CrossValidated, list[str]]:
    """Leave out what later explanations have made needless; the ids of what was left out."""
    gone: list[str] = []
    for name in names:
        setting = now.fitted.setting.leaving(name)
        less = contest(
            fit(
                now.fitted.rows,
                setting,
                now.fitted.used,
                variance_inflation=now.fitted.variance_inflation,
            ),
            now.trial,
        )
        # What is left must not make up for it by running to an end: a reading of which nothing is
        # left, say, contradicts no law any more.
        if net_gain(now, less) < limits.NEEDED and not at_an_end(less, *setting.joined):
            now = less
            gone.append(name)
    return now, gone


def instead(
    now: CrossValidated, winner: str, trials: Sequence[InitialCandidate]
) -> tuple[CrossValidated, str]:
    """Ask again whether another explanation does better, now that periods are cut anew.

    Periods were cut before anything explained what they stood beside: that may have favoured one.
    """
    setting = now.fitted.setting.leaving(winner)
    bare = fit(now.fitted.rows, setting, now.fitted.used, 0, None, now.fitted.variance_inflation)
    for trial in trials:
        again = recut(entered(bare, trial))
        if odds_of(again, now) > 1.0 and not at_an_end(again, trial.candidate):
            now, winner = again, trial.candidate.id
    return now, winner
