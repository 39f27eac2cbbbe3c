"""What an explanation costs before any data."""

from __future__ import annotations

import numpy as np

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.configuration import HIDDEN, Course
from rulec.mismatch.evidence.steady.fit import Fitted


def price_of_fit(fitted: Fitted) -> float:
    """What a model costs before any data: rare explanations, periods, values let go.

    Blocks held apart cannot judge periods, so each pays for its ends and its degree. A calibration
    that is let go pays for every value as a fit without one would, less what it did not say.
    """
    setting = fitted.setting
    each = 0.5 * float(np.log(max(fitted.rows.groups, 2)))
    hidden = {u.id for c in setting.joined if c.sort == HIDDEN for u in c.unknowns}
    steps = sum(
        limits.PERIOD_PRICE * len(c.periods) for c in setting.courses if c.unknown not in hidden
    )
    levels = sum(c.levels for c in setting.courses)
    signals = fitted.rows.system.ruleset.signal_by_id
    rare = sum(
        limits.RARITY[c.sort] + (limits.COMMON if c.members else 0.0) for c in setting.joined
    )
    coming = {course.unknown for course in setting.courses}
    for candidate in setting.joined:
        if coming & {u.id for u in candidate.unknowns}:
            of_sensor = f"{candidate.module}.{candidate.place}" in signals
            # What follows a driver that nobody recorded is a law sooner than a reading.
            sort = limits.RARITY["sensor"] if candidate.sort == HIDDEN else 0.0
            rare += (limits.FLICKERING + sort) * of_sensor
    rare += limits.HEALED * sum(
        _ends(c, fitted) for c in setting.courses if c.unknown not in hidden
    )
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
    base = fitted.rows.system.builder.parameters
    before = np.sqrt(np.diag(base.covariance))
    price = 0.0
    for name, u in zip(base.ids, before, strict=True):
        if name.partition(".")[0] in free and name in fitted.prior.names:
            after = max(fitted.u(name), 1e-12 * u)
            price += float(np.clip(each - np.log(max(u, 1e-300) / after), 0.0, each))
    return price
