"""What counts for an explanation: its gain, less what it costs before any data."""

from __future__ import annotations

import numpy as np

from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import variance_inflation_of
from rulec.mismatch.search.compete import CrossValidated
from rulec.mismatch.search.price import price_of_fit


def price_of(contestant: CrossValidated) -> float:
    """What the model of a contestant costs before any data."""
    return price_of_fit(contestant.fitted)


def net_gain(contestant: CrossValidated, now: CrossValidated) -> float:
    """Gain over a model less the price of what it has more."""
    return contestant.gain_over(now) - price_of(contestant) + price_of(now)


def gain_in_sample(contestant: CrossValidated, now: CrossValidated) -> float:
    """The same on the blocks it was fitted to.

    Blocks held apart cannot judge what is free in time: its values are taken from all of them.
    """
    fitted, used = contestant.fitted, contestant.fitted.used[contestant.fitted.rows.group_point]
    gain = float(np.sum((fitted.likelihood - now.fitted.likelihood)[used]))
    return gain + contestant.relief_over(now) - price_of(contestant) + price_of(now)


def needed(now: CrossValidated, tried: int) -> float:
    """Gain that is worth naming."""
    return limits.NEEDED + float(np.log(max(tried, 1))) + limits.WORTH * now.fitted.rows.groups


def _said(setting: Configuration) -> tuple[int, int]:
    """Values that are free, and modules that something is said of."""
    return len(setting.free_unknowns()), sum(len(c.modules) for c in setting.joined)


def says_the_same(one: CrossValidated, other: CrossValidated) -> bool:
    """Do two models, each refitted, leave the same errors with as many values?

    A constant loss and the offset of a meter do, as may a law and its mirror image: nothing that
    was recorded, nor what is left out how often, tells which of them it is.
    """
    # What is said of several modules says more, also where the others do not show it.
    counts = [_said(c.fitted.setting) for c in (one, other)]
    if counts[0] != counts[1] or len(one.fitted.residual) != len(other.fitted.residual):
        return False
    fitted = one.fitted
    apart = np.sum(fitted.weights * (fitted.residual - other.fitted.residual) ** 2)
    return 0.5 * float(apart) < limits.SAYS_THE_SAME


def odds_of(other: CrossValidated, winner: CrossValidated) -> float:
    """Odds of another explanation against the winner; even where both say the same.

    The likelihood counts as often as neighbours say something new; where the difference scatters
    over blocks so that its sign is open, the odds are nearer to one.
    """
    if says_the_same(other, winner):
        return 1.0
    # Neighbours are as alike as the winner leaves them, not as they were before it.
    variance_inflation = min(winner.fitted.variance_inflation, variance_inflation_of(winner.fitted))
    ahead = winner.likelier_than(other) / variance_inflation + winner.relief_over(other)
    ahead += price_of(other) - price_of(winner)
    lead = max(winner.certainty_over(other), 0.0)
    scattered = float(np.exp(-0.5 * lead**2 - 0.8 * lead))
    scattered *= float(np.exp(min(price_of(winner) - price_of(other), 0.0)))
    return max(float(np.exp(np.clip(-ahead, -700.0, 50.0))), scattered)
