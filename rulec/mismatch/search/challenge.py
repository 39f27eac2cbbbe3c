"""What was found is challenged: by what is freer, and by two names at once."""

from __future__ import annotations

from collections.abc import Sequence

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits
from rulec.mismatch.search.compete import CrossValidated, contest, refit
from rulec.mismatch.search.free_form import best_curve, free_form_trials
from rulec.mismatch.search.pairs import torn_pairs
from rulec.mismatch.search.periods import coming_and_going, periods_of
from rulec.mismatch.search.weigh import gain_in_sample, needed, net_gain
from rulec.mismatch.search.winner import Step, contested, first_to_win, gain_of


def challenged(
    found: Step,
    now: CrossValidated,
    ranked: Sequence[CrossValidated],
    free: Sequence[Candidate],
    hidden: CrossValidated | None,
) -> Step:
    """What was found, unless something freer says more, or two names more than that."""
    other = _or_sudden(found, now, free, hidden)
    other = _or_nameless(other, now)
    if other.winner is found.winner:
        return found
    return _or_both(other, now, ranked, free, hidden)


def _or_sudden(
    found: Step, now: CrossValidated, candidates: Sequence[Candidate], hidden: CrossValidated | None
) -> Step:
    """A fault that begins, where that says more than what lasts, and leaves nothing of it: a driver
    may happen to turn about when the fault began, and what is left of a fault can look like a law.
    """
    fitted, winner = now.fitted, found.winner
    trial = None if winner is None else winner.trial
    if trial is None or winner is None or not found.records or trial.course is not None:
        return found
    hopeless = limits.HOPELESS * net_gain(winner, now)
    coming = coming_and_going(fitted, candidates)
    begun = [t for t in coming if periods_of(t) <= limits.FEW_CHANGES and t.gain > hopeless]
    sudden = contested([refit(fitted, t) for t in begun], now)
    better = first_to_win(now, sudden, hidden, found.tried)
    if better is None or better.winner is None or not better.records:
        return found
    if net_gain(better.winner, now) <= net_gain(winner, now):
        return found
    beside = contest(*refit(better.winner.fitted, trial))
    left = gain_in_sample(beside, better.winner)
    return found if left > needed(better.winner, better.tried) else better


def _or_nameless(found: Step, now: CrossValidated) -> Step:
    """A term without physics, where it explains much more than the best name does.

    A free curve over one reading pays for each piece: laws that hold are explained about as well by
    their names. If the curve is far ahead, the name only imitates what is there.
    """
    if found.winner is None or not found.records:
        return found
    curve, named = best_curve(now.fitted), net_gain(found.winner, now)
    driven = found.winner.trial is not None and periods_of(found.winner.trial) > 1
    share = limits.DRIVEN if driven else limits.SURPASSED
    if curve is None or curve.gain < share * named + limits.NEEDED:
        return found
    unnamed = contested([refit(now.fitted, t) for t in free_form_trials(now.fitted)], now)
    free = first_to_win(now, unnamed, None, found.tried)
    # A few bands are a coarse curve: on other blocks it does worse than periods cut to measure.
    least = limits.COARSE * share if driven else share
    return free if free is not None and gain_of(free, now) > least * named else found


def _or_both(
    found: Step,
    now: CrossValidated,
    ranked: Sequence[CrossValidated],
    free: Sequence[Candidate],
    hidden: CrossValidated | None,
) -> Step:
    """Two names at once, where a single one was found and gave way to what is freer.

    Of two laws that are left out, one alone does not do well everywhere: a fault that begins or a
    curve then does better than it, and worse than both.
    """
    pairs = torn_pairs(now.fitted, ranked, free)
    both = first_to_win(now, contested(pairs, now), hidden, found.tried)
    ahead = gain_of(both, now) > gain_of(found, now) + limits.NEEDED
    return both if both is not None and both.records and ahead else found
