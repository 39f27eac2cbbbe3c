"""Nonparametric terms at a place: piecewise linear curves over one reading, with knots at its
quantiles or at given values."""

from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate, CurveTerm, DisturbanceLocation, Unknown
from rulec.effects.limits import CURVE_DIGITS, CURVE_KEPT, CURVE_POINT
from rulec.effects.match_effects import Matched
from rulec.knowledge.module_type import Parameter
from rulec.knowledge.tables import PER, SIZE, equations
from rulec.language.diagnostics import Origin
from rulec.language.expression import parse
from rulec.language.limits import MAX_EQUATION_LENGTH
from rulec.language.units import UNKNOWN, Unit
from rulec.language.write_yaml import rounded
from rulec.passes.amend import Change

BAND = "~"
"""Separates a reading from the number of its band."""

BENDS = 5
"""Bends of a curve in one equation."""


def free_form(location: DisturbanceLocation, id_: str, bands: tuple[str, ...]) -> Matched:
    """The candidate of an additive curve over one reading, with coefficients in the unit of the
    place.

    A band such as ``A.n~3/8`` is 1 at the quantile 3/8 of the reading, and 0 from those at 2/8 and
    4/8 on.
    """
    signal = bands[0].partition(BAND)[0]
    ends = [band.partition(BAND)[2].partition("/") for band in bands]
    parts, numbers = int(ends[0][2]), [int(number) for number, _, _ in ends]
    terms, unknowns = [], []
    for i, number in enumerate(numbers, 1):
        terms.append(f"c{i}*{_band(number, parts)}")
        unknowns.append(_coefficient(id_, i, f"{signal}, band {number} of {parts}", location))
    for knot in sorted({k for n in numbers for k in (n - 1, n, n + 1) if 0 <= k <= parts}):
        title = f"quantile {knot}/{parts} of {signal}"
        unknowns.append(_knot(id_, knot, title, signal, knot / parts))
    return _matched(location, id_, f"law + {' + '.join(terms)}", unknowns, signal)


def _band(number: int, parts: int) -> str:
    """1 at a knot, falling linearly to 0 at its neighbours; 1 beyond the first and last knots.

    >>> _band(0, 4)
    'max(min((x_1 - x1)/(x_1 - x_0), 1), 0)'
    """
    rise = f"(x1 - x_{number - 1})/(x_{number} - x_{number - 1})" if number > 0 else "1"
    fall = f"(x_{number + 1} - x1)/(x_{number + 1} - x_{number})" if number < parts else "1"
    first, second = (rise, fall) if number > 0 else (fall, rise)
    return f"max(min({first}, {second}), 0)"


def bent_line(
    location: DisturbanceLocation, id_: str, driver: str, bends: range, knots: int
) -> Matched:
    """The candidate of some bends of a curve that is linear between knots, constant beyond them.

    ``c0`` is its value up to the first knot, with the bend there; ``c1`` and on are the changes of
    slope at the knots, per SI unit of the driver; ``x_0`` and on are the knots, fixed.
    """
    numbers = [*([0] if 0 in bends else []), *(k + 1 for k in bends)]
    unknowns = [_coefficient(id_, i, f"{driver}, bend {i}", location) for i in numbers]
    terms = [*(["c0"] if 0 in bends else []), *(f"c{k + 1}*max(x1 - x_{k}, 0)" for k in bends)]
    for k in bends:
        title = f"knot {k} of {driver}"
        unknowns.append(_knot(id_, k, title, driver, k / (knots - 1)))
    return _matched(location, id_, f"law + {' + '.join(terms)}", unknowns, driver)


def curve_through(place: str, driver: str, at: Array, value: Array) -> CurveTerm:
    """A curve through values, shape (n,), SI, with as few points as keep to it, and no more than an
    equation may have."""
    chosen = [0, len(at) - 1]
    while (len(chosen) + 2) * (CURVE_POINT + len(driver)) < MAX_EQUATION_LENGTH:
        off = np.abs(np.interp(at, at[chosen], value[chosen]) - value)
        if off.max() <= CURVE_KEPT * float(np.ptp(value)):
            break
        chosen = sorted([*chosen, int(np.argmax(off))])
    points = zip(at[chosen].tolist(), value[chosen].tolist(), strict=True)
    return CurveTerm(place, driver, tuple(points))


def curve_term(location: DisturbanceLocation, curve: CurveTerm, over: Unit) -> Matched:
    """The candidate of a curve, in the unit of the place `over` that of its driver."""
    shown = [
        (rounded(x / over.factor, CURVE_DIGITS), rounded(y / location.factor, CURVE_DIGITS))
        for x, y in curve.points
    ]
    (first, low), (last, high) = shown[0], shown[-1]
    # A table goes on straight beyond its ends.
    level = [(first - (last - first), low), *shown, (last + (last - first), high)]
    law = equations("curve", {"over": "x1", "points": level})["curve"]
    unknowns = [
        Unknown(
            id=f"{curve.id}.curve_{end}",
            name=f"curve_{end}",
            title=f"unit of {what}",
            unit=unit,
            factor=factor,
            fixed=True,
        )
        for end, what, unit, factor in (
            (SIZE, location.place, location.unit, location.factor),
            (PER, curve.driver, over.text, over.factor),
        )
    ]
    found = _matched(location, curve.id, f"law + {law}", unknowns, curve.driver)
    ends = f"{first:.4g} to {last:.4g}"
    candidate = replace(
        found.candidate,
        sort="curve",
        name="curve",
        title=f"Curve over {curve.driver} from {ends} {over.text}, without physics",
        equation=f"{location.place} = law + curve({curve.driver})",
        source="no physics",
    )
    return replace(found, candidate=candidate)


def _matched(
    location: DisturbanceLocation, id_: str, law: str, unknowns: list[Unknown], driver: str
) -> Matched:
    """The candidate of a law over ``x1``, a reading or a state."""
    change = Change(
        places=((location.kind, location.place),),
        law=parse(law),
        drivers={"x1": driver.removeprefix(f"{location.module}.")},
        parameters={u.name: _parameter(u) for u in unknowns},
        ids={u.name: u.id for u in unknowns},
    )
    candidate = Candidate(
        id=id_,
        sort="free",
        name="free-form",
        title="dependence that no entry names",
        module=location.module,
        place=location.place,
        observers=location.observers,
        unknowns=tuple(unknowns),
        drivers={"x1": driver},
        equation=f"{location.place} = {law}",
        text=f"{location.title} of {location.module} follows {driver} in a way that no entry names",
        action="",
        source="",
    )
    return Matched(candidate, change)


def _coefficient(id_: str, number: int, feature: str, location: DisturbanceLocation) -> Unknown:
    return Unknown(
        id=f"{id_}.c{number}",
        name=f"c{number}",
        title=f"share that follows {feature}",
        unit=location.unit,
        factor=location.factor,
        null=0.0,
    )


def _knot(id_: str, number: int, title: str, signal: str, quantile: float) -> Unknown:
    """A fixed quantile of the readings of a signal, SI."""
    return Unknown(
        id=f"{id_}.x_{number}",
        name=f"x_{number}",
        title=title,
        unit="SI",
        factor=1.0,
        quantiles=(quantile,),
        driver=signal,
        fixed=True,
    )


def _parameter(unknown: Unknown) -> Parameter:
    unit, title = Unit(unknown.unit, unknown.factor, UNKNOWN), unknown.title
    return Parameter(name=unknown.name, value=0.0, unit=unit, title=title, origin=Origin("", 0))
