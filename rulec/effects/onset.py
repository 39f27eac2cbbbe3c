"""Faults with an onset: a degree that acts from an unknown time on.

A deviation that a plant with states has from the beginning is part of its calibration. A fault was
not there before, so onset and degree are searched for together.
"""

from __future__ import annotations

import ast
import functools
from dataclasses import replace

from rulec.effects.candidate import TIME, Unknown
from rulec.knowledge.knowledge import Variant
from rulec.knowledge.module_type import Parameter
from rulec.language.expression import Expression
from rulec.language.rewrite import replaced, written
from rulec.language.units import NONE, SECOND, Unit
from rulec.limits import LATEST_ONSET, ONSET_QUANTILES, ONSET_WIDTH, START_DEGREE
from rulec.passes.amend import Change
from rulec.passes.store_faults import StoreFault

SINCE, CLOCK, HALF = "since", "t", "t_half"
"""Names in laws: time of the onset, time, and half of the recording."""

PERCENT, SECONDS = Unit("%", 0.01, NONE), Unit("s", 1.0, SECOND)

RISE = f"(1 + tanh(({CLOCK} - {SINCE})/({ONSET_WIDTH}*{HALF})))/2"
"""From 0 to 1 within a thousandth of the recording: a step that has slopes by its onset."""


@functools.cache
def beginning(law: Expression, degree: str = "x") -> Expression:
    """A law whose degree acts from the onset on.

    >>> from rulec.language.expression import parse
    >>> beginning(parse("law*(1 - x)")).text
    'law*(1 - x*((1 + tanh((t - since)/(0.002*t_half)))/2))'
    """
    rise = ast.parse(f"{degree}*({RISE})", mode="eval").body
    return written(replaced(law.tree, {degree: rise}))


def degree_unknown(id_: str, variant: Variant) -> Unknown:
    """The degree of a fault, to be searched for."""
    # A size is tried as a share of the range of its sensor.
    start = (
        START_DEGREE * variant.highest if variant.unit else min(START_DEGREE, variant.highest / 2)
    )
    shown = Unit(variant.unit, 1.0, NONE) if variant.unit else PERCENT
    return Unknown(
        id=id_,
        name="x",
        title=variant.meaning,
        unit=shown.text,
        factor=shown.factor,
        null=0.0,
        lowest=float(variant.lowest),
        highest=float(variant.highest),
        starts=(start,),
        usual=variant.usual,
    )


def beginning_change(stored: StoreFault) -> Change:
    """A fault of balances as a change of its module type, from an onset on."""
    origin = stored.fault.origin
    parameters = {
        "x": stored.change.parameters["x"],
        SINCE: Parameter(name=SINCE, value=0.0, unit=SECONDS, title="onset", origin=origin),
        HALF: Parameter(
            name=HALF,
            value=1.0,
            unit=SECONDS,
            fit=False,
            title="half of the recording",
            origin=origin,
        ),
    }
    return replace(
        stored.change,
        law=beginning(stored.change.law),
        drivers={CLOCK: TIME},
        parameters=parameters,
        ids={name: f"{stored.id}.{name}" for name in parameters},
    )


def beginning_unknowns(stored: StoreFault) -> tuple[Unknown, ...]:
    """Degree and onset of a fault, and half of the recording."""
    ids = {name: f"{stored.id}.{name}" for name in ("x", SINCE, HALF)}
    onset = Unknown(
        id=ids[SINCE],
        name=SINCE,
        title="onset",
        unit="s",
        factor=1.0,
        lowest=0.0,
        highest=LATEST_ONSET,
        quantiles=ONSET_QUANTILES,
        driver=TIME,
    )
    half = replace(onset, id=ids[HALF], name=HALF, title="", quantiles=(), fixed=True)
    return degree_unknown(ids["x"], stored.variant), onset, half
