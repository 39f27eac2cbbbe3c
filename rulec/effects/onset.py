"""Faults with an onset: a degree that acts from an unknown time on.

In a plant with states, calibration covers a deviation that exists from the beginning. A fault
begins later, so onset and degree are searched for together.
"""

import ast
import functools
from dataclasses import replace

from rulec.effects.candidate import TIME, Unknown
from rulec.effects.limits import LATEST_ONSET, ONSET_QUANTILES, ONSET_WIDTH, START_DEGREE
from rulec.knowledge.knowledge import Variant
from rulec.knowledge.module_type import Parameter
from rulec.language.expression import Expression, replaced, written
from rulec.language.units import SECOND, Unit
from rulec.passes.amend import Change
from rulec.passes.put_balances import StoreFault

SINCE, CLOCK, HALF = "since", "t", "t_half"
"""Names in laws: time of the onset, time, and half of the recording."""


@functools.cache
def beginning(law: Expression) -> Expression:
    """A law whose degree acts from the onset on.

    The degree rises within a thousandth of the recording, so that it has a slope by its onset.

    >>> from rulec.language.expression import parse
    >>> beginning(parse("law*(1 - x)")).text
    'law*(1 - x*((1 + tanh((t - since)/(0.002*t_half)))/2))'
    """
    rise = f"x*((1 + tanh(({CLOCK} - {SINCE})/({ONSET_WIDTH}*{HALF})))/2)"
    return written(replaced(law.tree, {"x": ast.parse(rise, mode="eval").body}))


def degree_unknown(id_: str, variant: Variant) -> Unknown:
    """The degree of a fault as an unknown."""
    # A degree with a unit starts at a share of the range of its sensor.
    start = (
        START_DEGREE * variant.highest if variant.unit else min(START_DEGREE, variant.highest / 2)
    )
    return Unknown(
        id=id_,
        name="x",
        title=variant.meaning,
        unit=variant.unit or "%",
        factor=1.0 if variant.unit else 0.01,
        null=0.0,
        lowest=float(variant.lowest),
        highest=float(variant.highest),
        starts=(start,),
        usual=variant.usual,
    )


def beginning_change(stored: StoreFault) -> Change:
    """A fault of balances as a change of its module type, with an onset."""
    unit, origin = Unit("s", 1.0, SECOND), stored.fault.origin
    since = Parameter(name=SINCE, value=0.0, unit=unit, title="onset", origin=origin)
    half = replace(since, name=HALF, value=1.0, fit=False, title="half of the recording")
    parameters = {"x": stored.change.parameters["x"], SINCE: since, HALF: half}
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
