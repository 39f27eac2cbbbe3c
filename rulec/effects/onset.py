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
    usual, start = variant.usual, min(START_DEGREE, variant.highest / 2)
    if variant.unit:
        # At its usual size, or at a share of the range of its sensor.
        start = START_DEGREE * variant.highest
        if usual is not None and not usual.of_place:
            start = usual.size
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
        usual=usual,
    )


def with_onset(fault: StoreFault) -> tuple[Change, tuple[Unknown, ...]]:
    """A fault as a change of its module type that acts from an onset on, and what is unknown of it:
    degree and onset; half of the recording is fixed."""
    ids = {name: f"{fault.id}.{name}" for name in ("x", SINCE, HALF)}
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
    since = Parameter(
        name=SINCE, value=0.0, unit=Unit("s", 1.0, SECOND), title="", origin=fault.fault.origin
    )
    changed = {SINCE: since, HALF: replace(since, name=HALF, value=1.0, fit=False)}
    change = replace(
        fault.change,
        law=beginning(fault.change.law),
        drivers={CLOCK: TIME},
        parameters={**fault.change.parameters, **changed},
        ids=ids,
    )
    return change, (degree_unknown(ids["x"], fault.variant), onset, half)
