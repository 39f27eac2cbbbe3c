"""The shape of a curve in words: where it rises and falls, by how much, and where it is flat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.report.text import number

from rulec.mismatch.answer import limits
from rulec.mismatch.answer.wording import quantity
from rulec.mismatch.result import Estimate

LEGS = 3
"""Rises and falls that are told one by one."""

ENDS_ALIKE = 0.3
"""Share of its height by which the ends of a bump may differ."""


@dataclass(frozen=True, kw_only=True)
class Drawable:
    """A curve as shown: `at`, `value` shape (n,), `covariance` (n, n), with their units."""

    at: Array
    value: Array
    covariance: Array
    driver_unit: str
    unit: str


def shape_words(curve: Drawable) -> tuple[str, bool]:
    """A curve in words, and whether it turns back nowhere.

    >>> z = np.linspace(0.0, 60.0, 31)
    >>> v = 0.8 * np.clip((z - 30.0) / 16.0, 0.0, 1.0)
    >>> shape_words(Drawable(at=z, value=v, covariance=1e-4 * np.eye(31), driver_unit="degC",
    ...                      unit="l/min"))
    ('rises by 0.800 ± 0.014 l/min from 30 to 46 degC, flat below and above', True)
    """
    turns = turns_of(curve)
    legs = list(pairwise(turns))
    if not legs:
        return "no rise or fall that is beyond chance", True
    if len(legs) == 1:
        return _one(curve, *legs[0]), True
    if len(legs) == 2:
        return _two(curve, *turns), False
    told = [_leg(curve, first, last) for first, last in legs[:LEGS]]
    more = f", and turns {len(legs) - LEGS} more times" if len(legs) > LEGS else ""
    return ", then ".join(told) + more, False


def turns_of(curve: Drawable) -> list[int]:
    """Points at which a curve turns, its ends included, so far as they are beyond chance."""
    value = curve.value
    turns: list[int] = []
    low = high = way = 0
    for k in range(1, len(value)):
        if way >= 0 and value[k] > value[high]:
            high = k
        if way <= 0 and value[k] < value[low]:
            low = k
        if way <= 0 and value[k] > value[low] and _clear(curve, low, k):
            turns.append(low)
            way, high = 1, k
        elif way >= 0 and value[k] < value[high] and _clear(curve, high, k):
            turns.append(high)
            way, low = -1, k
    return [*turns, high if way > 0 else low] if turns else []


def _clear(curve: Drawable, first: int, last: int) -> bool:
    change, u = _change(curve, first, last)
    height = float(np.ptp(curve.value))
    return abs(change) > max(limits.CURVE_CLEAR * u, limits.CURVE_STEP * height)


def _change(curve: Drawable, first: int, last: int) -> tuple[float, float]:
    """How much a curve changes from one point to another, with its standard uncertainty."""
    c = curve.covariance
    variance = c[first, first] + c[last, last] - 2.0 * c[first, last]
    return float(curve.value[last] - curve.value[first]), float(np.sqrt(max(variance, 0.0)))


def _one(curve: Drawable, first: int, last: int) -> str:
    """A curve that turns back nowhere."""
    begin, end = _edges(curve, first, last)
    low, high = float(curve.at[0]), float(curve.at[-1])
    whole = high - low
    if end - begin >= limits.CURVE_WHOLE * whole:
        way, amount = _amount(curve, first, last)
        return f"{way} steadily by {amount} from {_between(curve, low, high)}"
    flat = [
        word
        for word, there in (
            ("below", begin - low > limits.CURVE_FLAT * whole),
            ("above", high - end > limits.CURVE_FLAT * whole),
        )
        if there
    ]
    way, amount = _amount(curve, first, last)
    begin, end = begin if "below" in flat else low, end if "above" in flat else high
    words = f"{way} by {amount} from {_between(curve, begin, end)}"
    return f"{words}, flat {' and '.join(flat)}" if flat else words


def _two(curve: Drawable, first: int, middle: int, last: int) -> str:
    """A curve that turns once: a bump or a dip where its ends are alike."""
    there, back = (_change(curve, a, b)[0] for a, b in ((first, middle), (middle, last)))
    if abs(there + back) > ENDS_ALIKE * max(abs(there), abs(back)):
        return f"{_leg(curve, first, middle)}, then {_leg(curve, middle, last)}"
    _, amount = _amount(curve, first if abs(there) > abs(back) else last, middle)
    half = curve.value[middle] - 0.5 * np.sign(there) * max(abs(there), abs(back))
    beyond = np.flatnonzero(np.sign(there) * (curve.value - half) >= 0.0)
    begin, end = (float(curve.at[i]) for i in (beyond[0], beyond[-1]))
    what = "bump" if there > 0 else "dip"
    unit = _unit(curve.driver_unit)
    return (
        f"a {what} of {amount} near {number(float(curve.at[middle]))}{unit}, half of it left at "
        f"{number(begin)} and {number(end)}{unit}"
    )


def _leg(curve: Drawable, first: int, last: int) -> str:
    way, amount = _amount(curve, first, last)
    ends = _between(curve, float(curve.at[first]), float(curve.at[last]))
    return f"{way} by {amount} from {ends}"


def _amount(curve: Drawable, first: int, last: int) -> tuple[str, str]:
    change, u = _change(curve, first, last)
    estimate = Estimate("", abs(change), u, float("nan"), float("nan"), curve.unit)
    return "rises" if change > 0 else "falls", quantity(estimate)


def _edges(curve: Drawable, first: int, last: int) -> tuple[float, float]:
    """Between which values of the driver a curve changes, but for a share at either end."""
    part = curve.value[first : last + 1]
    share = (part - part[0]) / (part[-1] - part[0])
    begin = int(np.flatnonzero(share <= limits.CURVE_FLAT)[-1])
    end = int(np.flatnonzero(share >= 1.0 - limits.CURVE_FLAT)[0])
    return float(curve.at[first + begin]), float(curve.at[first + end])


def _between(curve: Drawable, low: float, high: float) -> str:
    return f"{number(low)} to {number(high)}{_unit(curve.driver_unit)}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def memory_words(gap: float, u: float, unit: str, counts: Sequence[int]) -> str:
    """How much both branches differ, and from how many visits that is known."""
    size = quantity(Estimate("", abs(gap), u, float("nan"), float("nan"), unit))
    side = "risen" if gap > 0 else "fallen"
    return (
        f"{size} more after its driver has {side} ({counts[0]} visits from below, "
        f"{counts[1]} from above)"
    )
