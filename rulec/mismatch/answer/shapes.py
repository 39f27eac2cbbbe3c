"""Terms without a name over their driver: their shape, in words, with memory and rivals."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.report.text import number

from rulec.effects.candidate import TIME
from rulec.mismatch import limits
from rulec.mismatch.answer.wording import quantity, suffix
from rulec.mismatch.evidence.model import Model, Variable
from rulec.mismatch.result import UNDECIDED, Beaten, Region, Shape
from rulec.mismatch.search.curve_found import Branches, CurveFound, RejectedCandidate

LEGS = 3
"""Most rises and falls that are listed one by one."""

ENDS_ALIKE = 0.3
"""Share of its height by which the ends of a bump may differ."""


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A curve as shown: `at`, `value` shape (n,), `covariance` (n, n), with their units."""

    at: Array
    value: Array
    covariance: Array
    driver_unit: str
    unit: str

    def change(self, first: int, last: int) -> tuple[float, float]:
        """The change from one point to another, with its standard uncertainty."""
        c = self.covariance
        variance = c[first, first] + c[last, last] - 2.0 * c[first, last]
        return float(self.value[last] - self.value[first]), float(np.sqrt(max(variance, 0.0)))


def shape_of(model: Model, found: CurveFound) -> Shape | None:
    """The shape in the units of its place and of its driver; None if that is not recorded."""
    time = Variable(model.samples.time, 1.0, 0.0, "s")
    driver = time if found.driver == TIME else model.variable(found.driver)
    if driver is None:
        return None
    factor = found.location.factor
    curve, level = _from_its_level(
        Curve(
            at=driver.shown(found.at),
            value=found.value / factor,
            covariance=found.covariance / factor**2,
            driver_unit=driver.unit,
            unit=found.location.unit,
        )
    )
    text, monotone = shape_words(curve)
    memory, because = _memory(model, found)
    means = np.column_stack([driver.shown(found.means[:, 0]), found.means[:, 1:] / factor])
    means[:, 1] -= level
    return Shape(
        driver=found.driver,
        driver_unit=driver.unit,
        unit=found.location.unit,
        at=curve.at,
        value=curve.value,
        u=np.sqrt(np.maximum(np.diag(curve.covariance), 0.0)),
        means=means,
        text=text,
        monotone=monotone,
        memory=memory,
        memory_text=because,
        beaten=tuple(_beaten(lost, found.driver, driver) for lost in found.lost),
    )


def _from_its_level(curve: Curve) -> tuple[Curve, float]:
    """A curve relative to the level at which it begins, and that level, which is a matter of
    calibration: its uncertainty says nothing of the shape."""
    begin = next(iter(turns_of(curve)), None)
    near = np.ones(len(curve.at), dtype=bool)
    if begin is not None:
        off = np.abs(curve.value - curve.value[begin])
        near = off <= limits.CURVE_FLAT * float(np.ptp(curve.value))
    weights = near / near.sum()
    less = np.eye(len(near)) - weights
    moved = replace(curve, value=less @ curve.value, covariance=less @ curve.covariance @ less.T)
    return moved, float(weights @ curve.value)


def _memory(model: Model, found: CurveFound) -> tuple[str, str]:
    """Does it matter from which side the driver came? Yes and no both need certainty."""
    branches = found.branches
    if branches is None:
        if found.driver == TIME:
            return UNDECIDED, "it was examined over time only"
        if not model.samples.timed:
            because = "the samples have no common time, so the direction of the driver is unknown"
            return UNDECIDED, because
        return UNDECIDED, "its driver was not approached from both sides often enough"
    gap, u = (abs(v / found.location.factor) for v in (branches.gap, branches.u))
    side = "risen" if branches.gap / found.location.factor > 0 else "fallen"
    return answer_of(branches, float(np.ptp(found.value))), (
        f"{quantity(gap, u, found.location.unit)} more after its driver has {side} "
        f"({branches.rising} visits from below, {branches.falling} from above)"
    )


def answer_of(branches: Branches, height: float) -> str:
    """Yes or no if either is certain: does a gap matter compared with the height of a curve?"""
    gap, least = abs(branches.gap), limits.CURVE_COUNTS * height
    if gap > limits.CURVE_CLEAR * branches.u and gap > least:
        return "yes"
    return "no" if gap + limits.NORMAL_95 * branches.u < least else UNDECIDED


def _beaten(lost: RejectedCandidate, name: str, driver: Variable) -> Beaten:
    candidate, region = lost.candidate, None
    if lost.between is not None:
        low, high = (None if end is None else float(driver.shown(end)) for end in lost.between)
        region = Region(name, low, high, driver.unit, lost.share)
    return Beaten(candidate.name, candidate.title, lost.nats, region)


def shape_words(curve: Curve) -> tuple[str, bool]:
    """A curve in words, and whether it is monotone.

    >>> z = np.linspace(0.0, 60.0, 31)
    >>> v = 0.8 * np.clip((z - 30.0) / 16.0, 0.0, 1.0)
    >>> shape_words(Curve(at=z, value=v, covariance=1e-4 * np.eye(31), driver_unit="degC",
    ...                   unit="l/min"))
    ('rises by 0.800 ± 0.014 l/min from 30 to 46 degC, flat below and above', True)
    """
    turns = turns_of(curve)
    legs = list(pairwise(turns))
    if not legs:
        return "no rise or fall that is beyond chance", True
    if len(legs) == 1:
        return _one(curve, *turns), True
    if len(legs) == 2:
        there, back = (curve.change(*leg)[0] for leg in legs)
        if abs(there + back) <= ENDS_ALIKE * max(abs(there), abs(back)):
            amount = _amount(curve, *max(legs, key=lambda leg: abs(curve.change(*leg)[0])))
            near = f"{number(float(curve.at[turns[1]]))}{suffix(curve.driver_unit)}"
            return f"a {'bump' if there > 0 else 'dip'} of {amount} near {near}", False
    shown = [_leg(curve, a, b, float(curve.at[a]), float(curve.at[b])) for a, b in legs[:LEGS]]
    more = f", and turns {len(legs) - LEGS} more times" if len(legs) > LEGS else ""
    return ", then ".join(shown) + more, False


def turns_of(curve: Curve) -> list[int]:
    """Significant turning points of a curve, including its ends."""
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


def _clear(curve: Curve, first: int, last: int) -> bool:
    change, u = curve.change(first, last)
    least = limits.CURVE_COUNTS * float(np.ptp(curve.value))
    return abs(change) > max(limits.CURVE_CLEAR * u, least)


def _one(curve: Curve, first: int, last: int) -> str:
    """A monotone curve, and where it is flat."""
    share = (curve.value[first : last + 1] - curve.value[first]) / curve.change(first, last)[0]
    begin = curve.at[first + int(np.flatnonzero(share <= limits.CURVE_FLAT)[-1])]
    end = curve.at[first + int(np.flatnonzero(share >= 1.0 - limits.CURVE_FLAT)[0])]
    low, high = curve.at[0], curve.at[-1]
    least = limits.CURVE_FLAT * (high - low)
    flat = ["below"] * bool(begin - low > least) + ["above"] * bool(high - end > least)
    ends = (begin if "below" in flat else low, end if "above" in flat else high)
    words = _leg(curve, first, last, *map(float, ends))
    return f"{words}, flat {' and '.join(flat)}" if flat else words


def _leg(curve: Curve, first: int, last: int, low: float, high: float) -> str:
    way = "rises" if curve.value[last] > curve.value[first] else "falls"
    ends = f"{number(low)} to {number(high)}{suffix(curve.driver_unit)}"
    return f"{way} by {_amount(curve, first, last)} from {ends}"


def _amount(curve: Curve, first: int, last: int) -> str:
    change, u = curve.change(first, last)
    return quantity(abs(change), u, curve.unit)
