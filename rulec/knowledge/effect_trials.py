"""Try the laws of an effect on drawn numbers, to see where they give the plain law back."""

import math
import random
from collections.abc import Iterable, Iterator, Mapping

from rulec.knowledge.effect import PLAIN, Effect, EffectLaw, Join
from rulec.knowledge.limits import EFFECT_TOLERANCE, EFFECT_TRIES, TRIED_READINGS
from rulec.language.expression import Expression, Rejected, constant

Values = dict[str, float]


def is_off_at_null(effect: Effect, join: Join) -> bool | None:
    """Whether the laws of a join give the plain law with all parameters at their null; None if they
    mostly give no number."""
    return _are_plain(join.laws, _trials(effect, join, at_null=True))


def is_neutral(effect: Effect, name: str) -> bool:
    """Whether each join gives the plain law if a driver, or that law, equals a fixed parameter."""

    def holds(join: Join, at: str) -> bool:
        return bool(_are_plain([join.law], _trials(effect, join, equal={name: at})))

    places = (effect.parameters[name].driver or "", PLAIN)
    used = [join for join in effect.joins if name in effect.used_by(join)]
    return bool(used) and all(any(holds(join, at) for at in places) for join in used)


def _are_plain(laws: Iterable[EffectLaw], trials: Iterable[tuple[Values, Values]]) -> bool | None:
    """Whether laws give the plain law in every trial, except for rounding; None if half of the
    trials give no number."""
    judged = 0
    for inputs, plain in trials:
        most = EFFECT_TOLERANCE * max(map(abs, plain.values()))
        try:
            values = [constant(law.expression, {**inputs, **plain}) for law in laws]
        except Rejected:
            continue
        if any(value is None or not abs(value - plain[PLAIN]) <= most for value in values):
            return False
        judged += 1
    return True if judged > EFFECT_TRIES // 2 else None


def _trials(
    effect: Effect, join: Join, at_null: bool = False, equal: Mapping[str, str] | None = None
) -> Iterator[tuple[Values, Values]]:
    """Readings with parameters, and values of the plain laws there; the same in every call.

    Parameters in `equal` are at the reading of a driver, or at the plain law. At the null, states
    have settled at the plain law, which is also where they start.
    """
    draw = random.Random(0)
    nulls = {n: p.null for n, p in effect.parameters.items() if p.null is not None}
    of_law = [n for n, p in effect.parameters.items() if p.driver == PLAIN]
    for _ in range(EFFECT_TRIES):
        inputs = readings(effect, draw)
        inputs |= parameters(effect, inputs, draw) | (nulls if at_null else {})
        inputs |= {name: inputs[at] for name, at in (equal or {}).items() if at in inputs}
        plain = plain_laws(join, inputs, draw)
        inputs |= {n: plain[PLAIN] * draw.uniform(0.5, 2.0) for n in of_law}
        inputs |= {name: plain[PLAIN] for name, at in (equal or {}).items() if at == PLAIN}
        yield inputs | (dict.fromkeys(effect.states, plain[PLAIN]) if at_null else {}), plain


def readings(effect: Effect, draw: random.Random) -> Values:
    """A reading of each driver, positive and of any order of magnitude."""
    return {name: math.exp(draw.uniform(*TRIED_READINGS)) for name in effect.drivers}


def parameters(effect: Effect, inputs: Mapping[str, float], draw: random.Random) -> Values:
    """Parameters near the reading of their driver, the others anywhere in their range.

    Those that are readings of the joined signal itself are left out.
    """
    return {
        name: inputs[p.driver] * draw.uniform(0.5, 2.0)
        if p.driver
        else draw.uniform(p.lowest, p.highest)
        for name, p in effect.parameters.items()
        if p.driver != PLAIN
    }


def plain_laws(join: Join, inputs: Mapping[str, float], draw: random.Random) -> Values:
    """Values of ``law`` and of each ``law(...)``: one smooth positive function of the drivers.

    A replacement of a driver that is no number counts as 0.
    """
    size = math.exp(draw.uniform(-7.0, 7.0))
    drivers = {name for replaced in join.law.substitutes.values() for name in replaced}
    bent = {name: (draw.uniform(-2.0, 2.0), abs(inputs[name]) or 1.0) for name in sorted(drivers)}

    def law(at: Mapping[str, float]) -> float:
        shapes = ((at[name], slope, scale) for name, (slope, scale) in bent.items())
        return size * math.exp(sum(slope * v / (abs(v) + scale) for v, slope, scale in shapes))

    def number(value: Expression) -> float:
        try:
            return constant(value, inputs) or 0.0
        except Rejected:
            return 0.0

    result = {PLAIN: law(inputs)}
    for key, replaced in join.law.substitutes.items():
        result[key] = law({**inputs, **{name: number(value) for name, value in replaced.items()}})
    return result
