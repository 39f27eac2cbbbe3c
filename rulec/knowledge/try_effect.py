"""Try the laws of an effect on random plain laws and readings."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Mapping

from rulec.knowledge.effect import PLAIN, Effect, Join
from rulec.knowledge.limits import EFFECT_TOLERANCE, EFFECT_TRIES, TRIED_READINGS
from rulec.language.expression import Rejected, constant


def fails_at_null(effect: Effect, join: Join) -> str:
    """Why the law differs from the plain law at the null of all parameters; "" if it does not."""
    undefined = 0
    for known, plain in _trials(effect, join, at_null=True):
        # States have settled at the plain law, which is also where they start.
        stored = dict.fromkeys(effect.states, plain[PLAIN])
        try:
            values = [constant(law.expression, {**known, **plain, **stored}) for law in join.laws]
        except Rejected:
            undefined += 1
            continue
        if not all(_is_plain(value, plain) for value in values):
            return "with all parameters at their null this does not give the plain law back"
    if undefined > EFFECT_TRIES // 2:
        return "with all parameters at their null this is mostly no number"
    return ""


def is_neutral(effect: Effect, name: str) -> bool:
    """Whether each join gives the plain law if a driver, or that law, equals a fixed parameter."""
    driver = effect.parameters[name].driver or ""
    used = [join for join in effect.joins if name in effect.used_by(join)]
    return bool(used) and all(
        _holds(effect, join, name, driver) or _holds(effect, join, name, PLAIN) for join in used
    )


def _holds(effect: Effect, join: Join, name: str, at: str) -> bool:
    judged = 0
    for known, plain in _trials(effect, join):
        known[name] = {**known, **plain}[at]
        try:
            value = constant(join.law.expression, {**known, **plain})
        except Rejected:
            continue
        if not _is_plain(value, plain):
            return False
        judged += 1
    return judged > EFFECT_TRIES // 2


def _is_plain(value: float | None, plain: Mapping[str, float]) -> bool:
    """Whether a value equals that of the plain law, except for rounding."""
    largest = max(map(abs, plain.values()))
    return value is not None and abs(value - plain[PLAIN]) <= EFFECT_TOLERANCE * largest


def _trials(
    effect: Effect, join: Join, at_null: bool = False
) -> Iterator[tuple[dict[str, float], dict[str, float]]]:
    """Readings with parameters, and values of the plain laws there; the same in every call."""
    draw = random.Random(0)
    nulls = {n: p.null for n, p in effect.parameters.items() if p.null is not None}
    for _ in range(EFFECT_TRIES):
        known = readings(effect, draw)
        known |= parameters(effect, known, draw) | (nulls if at_null else {})
        plain = plain_laws(join, known, draw)
        own = (n for n, p in effect.parameters.items() if p.fixed and p.driver == PLAIN)
        yield {**known, **{n: plain[PLAIN] * draw.uniform(0.5, 2.0) for n in own}}, plain


def readings(effect: Effect, draw: random.Random) -> dict[str, float]:
    """A reading of each driver, positive and of any order of magnitude."""
    return {name: math.exp(draw.uniform(*TRIED_READINGS)) for name in effect.drivers}


def parameters(effect: Effect, known: Mapping[str, float], draw: random.Random) -> dict[str, float]:
    """Parameters anywhere in their range; fixed ones near the reading of their driver.

    Those fixed at a reading of the joined signal itself are left out.
    """
    return {
        name: known[p.driver] * draw.uniform(0.5, 2.0)
        if p.fixed and p.driver
        else draw.uniform(p.lowest, p.highest)
        for name, p in effect.parameters.items()
        if not (p.fixed and p.driver == PLAIN)
    }


def plain_laws(join: Join, known: Mapping[str, float], draw: random.Random) -> dict[str, float]:
    """Values of ``law`` and of each ``law(...)``: one smooth positive function of the drivers.

    A replacement of a driver that is no number counts as 0.
    """
    size = math.exp(draw.uniform(-7.0, 7.0))
    drivers = {name for replaced in join.law.substitutes.values() for name in replaced}
    bent = {name: (draw.uniform(-2.0, 2.0), abs(known[name]) or 1.0) for name in sorted(drivers)}

    def law(at: Mapping[str, float]) -> float:
        shapes = ((at[name], slope, scale) for name, (slope, scale) in bent.items())
        return size * math.exp(sum(slope * v / (abs(v) + scale) for v, slope, scale in shapes))

    result = {PLAIN: law(known)}
    for key, replaced in join.law.substitutes.items():
        there = dict(known)
        for name, value in replaced.items():
            try:
                there[name] = constant(value, known) or 0.0
            except Rejected:
                there[name] = 0.0
        result[key] = law(there)
    return result
