"""How long to hold operating points, and which ones within limits: what each doubling is worth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.experiment import limits
from rulec.mismatch.experiment.choose import Choice, chosen
from rulec.mismatch.experiment.foretell import Foretold
from rulec.mismatch.experiment.limits_of_points import Within


@dataclass(frozen=True)
class Best:
    """Places that were chosen within limits, what each explanation foretells of means as long as
    they are held, and what hinders better ones: readings whose limits do, and whether time does."""

    choice: Choice
    told: Sequence[Foretold]
    limited: Within
    hindering: tuple[str, ...]
    time_is_short: bool


def best_within(
    told: Sequence[Foretold],
    odds: Array,
    most: int,
    seconds: float,
    limited: Within,
    settling: float,
) -> Best:
    """The places that tell most within limits, and how long to hold them, of which readings take so
    long to settle, s; such as cost no product where they tell as much."""
    plans: dict[int, tuple[Sequence[Foretold], Within, Choice]] = {}

    def worth(held: int) -> float:
        """What the best places are worth where each is held so many times as long."""
        if held not in plans:
            longer = _held(told, limited, held, settling)
            plans[held] = (*longer, _spared(*longer, odds, most, seconds))
        return plans[held][2].worth[-1] - limits.WORTH_DOUBLED * math.log2(held)

    longest = max(int(seconds // limited.seconds([0])), 1)
    coarse = [4**i for i in range(limits.MOST_QUADRUPLED) if 4**i <= longest]
    near = max(coarse, key=worth)
    best = max((h for h in (near // 2, near, 2 * near) if 1 <= h <= longest), key=worth)
    longer, within_, choice = plans[best]
    short = len(choice.places) < most and bool(
        chosen(longer, odds, most, among=within_.may_run).places[len(choice.places) :]
    )
    if 2 * best > longest:
        free = _held(told, limited, 2 * best, settling)
        more = chosen(free[0], odds, most, among=free[1].may_run)
        short = short or more.worth[-1] > choice.worth[-1] + limits.WORTH_DOUBLED
    hindering = _hindering(longer, odds, most, seconds, within_, choice)
    return Best(choice, longer, within_, hindering, short)


def _held(
    told: Sequence[Foretold], limited: Within, held: int, settling: float
) -> tuple[Sequence[Foretold], Within]:
    """What is foretold where each place is held so many times as long as it has to be."""
    limited = replace(limited, held=held)
    least = limited.shortest - settling
    times = (held * limited.shortest - settling) / least if least > 0.0 else float(held)
    return [one.held(times) for one in told], limited


def _spared(
    told: Sequence[Foretold], limited: Within, odds: Array, most: int, seconds: float
) -> Choice:
    """The places that tell most, or such as cost no product if they tell as much."""

    def in_time(places: Sequence[int]) -> bool:
        return limited.seconds(places) <= seconds

    choice = chosen(told, odds, most, among=limited.may_run, in_time=in_time)
    if any(limited.costs[place] for place in choice.places):
        free = limited.may_run & np.array([not costs for costs in limited.costs])
        spared = chosen(told, odds, most, among=free, in_time=in_time)
        if spared.worth[-1] >= choice.worth[-1] - limits.WORTH_PRODUCT:
            return spared
    return choice


def _hindering(
    told: Sequence[Foretold],
    odds: Array,
    most: int,
    seconds: float,
    limited: Within,
    choice: Choice,
) -> tuple[str, ...]:
    """Readings whose limits forbid places that tell more."""
    if not any(np.any(where & limited.possible) for where in limited.forbidden.values()):
        return ()
    wider = chosen(
        told,
        odds,
        most,
        among=limited.possible,
        in_time=lambda places: limited.seconds(places) <= seconds,
    )
    if wider.worth[-1] <= choice.worth[-1] + limits.WORTH_A_STEP:
        return ()
    at = list(wider.places)
    return tuple(name for name, where in limited.forbidden.items() if where[at].any())
