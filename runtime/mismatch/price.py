"""What counts for an explanation: its gain, less what it costs before any data."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from runtime.mismatch.candidate import Candidate
from runtime.mismatch.fit import Fitted, temper_of
from runtime.mismatch.periods import STEPS
from runtime.mismatch.setting import HIDDEN, Course, Setting

if TYPE_CHECKING:
    from runtime.mismatch.compete import Contestant

NEEDED = 8.0
"""Gain in log likelihood that an explanation needs beyond the logarithm of those tried and the
worth of all points. In 38 clean recordings the best explanation gained 8.5 in one, and less than
its price in the others; after this was chosen, none of 100 other clean recordings told anything."""

WORTH = 0.005
"""Gain per settled point that is worth naming: a term of about a tenth of the scatter."""

HOPELESS = 0.5
"""Share of the gain that is needed, or to be beaten, below which a trial is not refitted: its gain
is estimated to first order, and seldom doubles."""

RARITY = {"physics": 0.0, "ageing": 0.5, "fault": 1.0, "sensor": 2.5, "free": 20.0, "hidden": 0.0}
"""How much less expected each sort is, in log odds [assumed]: laws are simplified more often than
sensors leave their class. A free form is chosen among thousands, and pays for that."""

COMMON = 6.0
"""What a claim about several modules must gain more than one about a single module."""

SURPASSED = 1.35
"""Times the gain of a name that a free curve must gain to say that the name only imitates it."""

HEALED = 3.0
"""How much less expected a fault is with each time that it ends by itself, in log odds
[assumed]."""

FLICKERING = 2.0
"""How much less expected a sensor is that errs in some periods only, in log odds [assumed]."""


def price_of(contestant: Contestant) -> float:
    """What the model of a contestant costs before any data."""
    return price_of_fit(contestant.fitted)


def price_of_fit(fitted: Fitted) -> float:
    """What a model costs before any data: rare explanations, periods, values let go.

    Blocks held apart cannot judge periods, so each pays for its ends and its degree. A calibration
    that is let go pays for every value as a fit without one would, less what it did not say.
    """
    setting = fitted.setting
    each = 0.5 * float(np.log(max(fitted.rows.groups, 2)))
    hidden = {u.id for c in setting.joined if c.sort == HIDDEN for u in c.unknowns}
    steps = sum(STEPS * len(c.periods) for c in setting.courses if c.unknown not in hidden)
    levels = sum(c.levels for c in setting.courses)
    signals = fitted.rows.system.ruleset.signal_by_id
    rare = sum(RARITY[c.sort] + (COMMON if c.members else 0.0) for c in setting.joined)
    coming = {course.unknown for course in setting.courses}
    for candidate in setting.joined:
        if coming & {u.id for u in candidate.unknowns}:
            of_sensor = f"{candidate.module}.{candidate.place}" in signals
            # What follows a driver that nobody recorded is a law sooner than a reading.
            sort = RARITY["sensor"] if candidate.sort == HIDDEN else 0.0
            rare += (FLICKERING + sort) * of_sensor
    rare += HEALED * sum(_ends(c, fitted) for c in setting.courses if c.unknown not in hidden)
    shapes = sum(_shapes(c) for c in setting.joined)
    return each * (steps + levels + shapes) + rare + _freed(fitted, each)


def _ends(course: Course, fitted: Fitted) -> int:
    """How often a fault ends before the recording does, at points that are looked at."""
    there = course.segment[fitted.used] >= 0
    return int(np.sum(there[:-1] & ~there[1:]))


def _shapes(candidate: Candidate) -> int:
    """Values that shape a law beside its amplitude, such as a threshold or a time constant.

    Refits to half of the blocks hold them about where they were, which does not make them pay. A
    free form pays by its sort.
    """
    return 0 if candidate.sort in ("free", HIDDEN) else max(_free_values(candidate) - 1, 0)


def _free_values(candidate: Candidate) -> int:
    return sum(not unknown.fixed for unknown in candidate.unknowns)


def _freed(fitted: Fitted, each: float) -> float:
    """Price of the values that are let go: what they could be, over what they could be before.

    A value that was hardly known before is no freer without its prior; one that its data sheet
    holds is not free.
    """
    free = fitted.setting.released - fitted.setting.trusted
    base = fitted.rows.system.workshop.parameters
    before = np.sqrt(np.diag(base.covariance))
    price = 0.0
    for name, u in zip(base.ids, before, strict=True):
        if name.partition(".")[0] in free and name in fitted.prior.names:
            after = max(fitted.u(name), 1e-12 * u)
            price += float(np.clip(each - np.log(max(u, 1e-300) / after), 0.0, each))
    return price


def net_gain(contestant: Contestant, now: Contestant) -> float:
    """Gain over a model less the price of what it has more."""
    return contestant.gain_over(now) - price_of(contestant) + price_of(now)


def gain_in_sample(contestant: Contestant, now: Contestant) -> float:
    """The same on the blocks it was fitted to.

    Blocks held apart cannot judge what is free in time: its values are taken from all of them.
    """
    fitted, used = contestant.fitted, contestant.fitted.used[contestant.fitted.rows.group_point]
    gain = float(np.sum((fitted.likelihood - now.fitted.likelihood)[used]))
    return gain + contestant.relief_over(now) - price_of(contestant) + price_of(now)


def needed(now: Contestant, tried: int) -> float:
    """Gain that is worth naming."""
    return NEEDED + float(np.log(max(tried, 1))) + WORTH * now.fitted.rows.groups


SAME = 0.1
"""Log likelihood by which the predictions of two models differ at most that say the same: less
than a tenth of what is worth a remark between two explanations (1 by Jeffreys 1961, in nats)."""


def _said(setting: Setting) -> tuple[int, int]:
    """Values that are free, and modules that something is said of."""
    return len(setting.free_unknowns()), sum(len(c.modules) for c in setting.joined)


def says_the_same(one: Contestant, other: Contestant) -> bool:
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
    return 0.5 * float(apart) < SAME


def odds_of(other: Contestant, winner: Contestant) -> float:
    """Odds of another explanation against the winner; even where both say the same.

    The likelihood counts as often as neighbours say something new; where the difference scatters
    over blocks so that its sign is open, the odds are nearer to one.
    """
    if says_the_same(other, winner):
        return 1.0
    # Neighbours are as alike as the winner leaves them, not as they were before it.
    temper = min(winner.fitted.temper, temper_of(winner.fitted))
    ahead = winner.likelier_than(other) / temper + winner.relief_over(other)
    ahead += price_of(other) - price_of(winner)
    lead = max(winner.certainty_over(other), 0.0)
    scattered = float(np.exp(-0.5 * lead**2 - 0.8 * lead))
    scattered *= float(np.exp(min(price_of(winner) - price_of(other), 0.0)))
    return max(float(np.exp(np.clip(-ahead, -700.0, 50.0))), scattered)
