"""Nonparametric terms at a place: a sum of products of readings, or a piecewise linear curve over
one reading, with knots at its quantiles or at given values."""

from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import MEDIAN, Candidate, CurveTerm, DisturbanceLocation, Unknown
from rulec.effects.limits import CURVE_DIGITS, CURVE_KEPT, CURVE_POINT, SPREAD
from rulec.effects.match_effects import Matched
from rulec.knowledge.module_type import Parameter
from rulec.knowledge.tables import PER, SIZE, equations
from rulec.language.diagnostics import Origin
from rulec.language.expression import Expression, parse
from rulec.language.limits import MAX_EQUATION_LENGTH
from rulec.language.units import UNKNOWN, Unit
from rulec.language.write_yaml import rounded
from rulec.passes.amend import Change

BAND = "~"
"""Separates a reading from the number of its band."""

BENDS = 5
"""Bends of a curve in one equation."""


def free_form(spot: DisturbanceLocation, id_: str, features: tuple[str, ...]) -> Matched:
    """The candidate of an additive term, with coefficients in the unit of the place.

    A feature is a product of readings such as ``A.n*A.T``, or a band of one reading such as
    ``A.n~3/8``: 1 at its quantile 3/8, and 0 from those at 2/8 and 4/8 on.
    """
    if any(BAND in f for f in features):
        return _curve(spot, id_, features)
    signals = list(dict.fromkeys(s for f in features for s in f.split("*")))
    drivers = {f"x{i}": s for i, s in enumerate(signals, 1)}
    names = {s: n for n, s in drivers.items()}
    terms = []
    for i, feature in enumerate(features, 1):
        scaled = (f"(({names[s]} - {names[s]}_m)/{names[s]}_s)" for s in feature.split("*"))
        terms.append("*".join([f"c{i}", *scaled]))
    law = parse(f"law + {' + '.join(terms)}")
    unknowns = [_coefficient(id_, i, f, spot) for i, f in enumerate(features, 1)]
    for name, signal in drivers.items():
        unknowns.append(_statistic(id_, f"{name}_m", f"median of {signal}", signal, MEDIAN))
        unknowns.append(_statistic(id_, f"{name}_s", f"spread of {signal}", signal, SPREAD))
    return _matched(spot, id_, law, unknowns, drivers)


def _curve(spot: DisturbanceLocation, id_: str, features: tuple[str, ...]) -> Matched:
    signal = features[0].partition(BAND)[0]
    ends = [feature.partition(BAND)[2].partition("/") for feature in features]
    parts, numbers = int(ends[0][2]), [int(number) for number, _, _ in ends]
    terms, unknowns = [], []
    for i, number in enumerate(numbers, 1):
        terms.append(f"c{i}*{_band(number, parts)}")
        unknowns.append(_coefficient(id_, i, f"{signal}, band {number} of {parts}", spot))
    for knot in sorted({k for n in numbers for k in (n - 1, n, n + 1) if 0 <= k <= parts}):
        title = f"quantile {knot}/{parts} of {signal}"
        unknowns.append(_statistic(id_, f"x_{knot}", title, signal, (knot / parts,)))
    return _matched(spot, id_, parse(f"law + {' + '.join(terms)}"), unknowns, {"x1": signal})


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
    spot: DisturbanceLocation, id_: str, driver: str, bends: range, knots: int
) -> Matched:
    """The candidate of some bends of a curve that is linear between knots, constant beyond them.

    ``c0`` is its value up to the first knot, with the bend there; ``c1`` and on are the changes of
    slope at the knots, per SI unit of the driver; ``x_0`` and on are the knots, fixed.
    """
    numbers = [*([0] if 0 in bends else []), *(k + 1 for k in bends)]
    unknowns = [_coefficient(id_, i, f"{driver}, bend {i}", spot) for i in numbers]
    terms = [*(["c0"] if 0 in bends else []), *(f"c{k + 1}*max(x1 - x_{k}, 0)" for k in bends)]
    for k in bends:
        title = f"knot {k} of {driver}"
        unknowns.append(_statistic(id_, f"x_{k}", title, driver, (k / (knots - 1),)))
    return _matched(spot, id_, parse(f"law + {' + '.join(terms)}"), unknowns, {"x1": driver})


def curve_through(place: str, driver: str, at: Array, value: Array) -> CurveTerm:
    """A curve through values, shape (n,), SI, with as few points as keep to it, and no more than an
    equation may have."""
    kept = [0, len(at) - 1]
    while (len(kept) + 2) * (CURVE_POINT + len(driver)) < MAX_EQUATION_LENGTH:
        off = np.abs(np.interp(at, at[kept], value[kept]) - value)
        if off.max() <= CURVE_KEPT * float(np.ptp(value)):
            break
        kept = sorted([*kept, int(np.argmax(off))])
    points = zip(at[kept].tolist(), value[kept].tolist(), strict=True)
    return CurveTerm(place, driver, tuple(points))


def curve_term(spot: DisturbanceLocation, curve: CurveTerm, over: Unit) -> Matched:
    """The candidate of a curve, in the unit of the place `over` that of its driver."""
    shown = [
        (rounded(x / over.factor, CURVE_DIGITS), rounded(y / spot.factor, CURVE_DIGITS))
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
            (SIZE, spot.place, spot.unit, spot.factor),
            (PER, curve.driver, over.text, over.factor),
        )
    ]
    found = _matched(spot, curve.id, parse(f"law + {law}"), unknowns, {"x1": curve.driver})
    ends = f"{first:.4g} to {last:.4g}"
    candidate = replace(
        found.candidate,
        sort="curve",
        name="curve",
        title=f"Curve over {curve.driver} from {ends} {over.text}, without physics",
        equation=f"{spot.place} = law + curve({curve.driver})",
        source="no physics",
    )
    return replace(found, candidate=candidate)


def _matched(
    spot: DisturbanceLocation,
    id_: str,
    law: Expression,
    unknowns: list[Unknown],
    drivers: dict[str, str],
) -> Matched:
    candidate = Candidate(
        id=id_,
        sort="free",
        name="free-form",
        title="dependence that no entry names",
        module=spot.module,
        place=spot.place,
        observers=spot.observers,
        unknowns=tuple(unknowns),
        drivers=drivers,
        equation=f"{spot.place} = {law}",
        text=f"{spot.title} of {spot.module} follows {', '.join(drivers.values())} "
        "in a way that no entry names",
        action="",
        source="",
    )
    change = Change(
        places=((spot.kind, spot.place),),
        law=law,
        drivers={n: s.removeprefix(f"{spot.module}.") for n, s in drivers.items()},
        parameters={u.name: _parameter(u) for u in unknowns},
        ids={u.name: u.id for u in unknowns},
    )
    return Matched(candidate, change)


def _coefficient(id_: str, number: int, feature: str, spot: DisturbanceLocation) -> Unknown:
    return Unknown(
        id=f"{id_}.c{number}",
        name=f"c{number}",
        title=f"share that follows {feature}",
        unit=spot.unit,
        factor=spot.factor,
        null=0.0,
    )


def _statistic(
    id_: str, name: str, title: str, signal: str, quantiles: tuple[float, ...]
) -> Unknown:
    """A fixed quantile or spread of the readings of a signal, SI."""
    return Unknown(
        id=f"{id_}.{name}",
        name=name,
        title=title,
        unit="SI",
        factor=1.0,
        quantiles=quantiles,
        driver=signal,
        fixed=True,
    )


def _parameter(unknown: Unknown) -> Parameter:
    unit, title = Unit(unknown.unit, unknown.factor, UNKNOWN), unknown.title
    return Parameter(name=unknown.name, value=0.0, unit=unit, title=title, origin=Origin("", 0))
