"""The first statements of a routine: whether its readings may be used, and their values in SI."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import rulec_runtime.limits as runtime_limits
from rulec_runtime.contract.ruleset import SignalSpec
from rulec_runtime.recordings.recording_file import largest_reading

from rulec.export.identifiers import Identifiers
from rulec.export.program import Expression, Name, Number, Section, Statement, Variable, apply


@dataclass(frozen=True)
class Reading:
    """A reading as input of a routine: its value, and whether the controller calls it good. `ok`
    says that it is good and in range; `si` is its value, or a harmless one if it is not `ok`."""

    signal: SignalSpec
    value: Variable
    good: Variable
    si: Name
    ok: Name


def reading_of(signal: SignalSpec, module: str, names: Identifiers) -> Reading:
    """A reading with new names; for a reading of another module they include that module."""
    owner, _, short = signal.id.partition(".")
    base = short if owner == module else signal.id
    value = Variable(names.new(base), signal.id, "real", signal.unit, signal.title)
    text = f"{value.name} comes from its sensor, and is no substitute"
    good = Variable(names.new(f"{base}_good"), f"good:{signal.id}", "bool", "", text)
    return Reading(
        signal, value, good, Name(names.new(f"{base}_SI")), Name(names.new(f"{base}_ok"))
    )


def checked(readings: Iterable[Reading]) -> Section:
    """Checks and conversions of readings."""
    return Section(
        "Readings: may they be used, and their values in SI (a harmless one where they may not)",
        tuple(s for reading in readings for s in _statements(reading)),
    )


def _statements(reading: Reading) -> list[Statement]:
    low, high = usable_range(reading.signal)
    given, ok = Name(reading.value.name), reading.ok
    inside = apply("and", apply("ge", given, Number(low)), apply("le", given, Number(high)))
    unit = reading.signal.unit
    return [
        Statement(ok.text, apply("and", Name(reading.good.name), inside), "bool"),
        Statement(
            reading.si.text,
            apply("select", ok, in_si(reading.signal, given), Number(reading.signal.reference)),
            comment=f"from {unit}" if unit else "",
        ),
    ]


def noise_in_si(signal: SignalSpec, noise: Expression) -> Expression:
    """Standard uncertainty by noise, SI; an invalid one counts as the width of the range."""
    low, high = usable_range(signal)
    widest = Number(high - low)
    usable = apply("and", apply("ge", noise, Number(0.0)), apply("le", noise, widest))
    usable_noise = apply("select", usable, noise, widest)
    factor = abs(signal.factor)
    return usable_noise if factor == 1.0 else apply("mul", usable_noise, Number(factor))


def in_si(signal: SignalSpec, value: Expression) -> Expression:
    """A value in the unit of its sensor, converted to SI."""
    if signal.factor != 1.0:
        value = apply("mul", value, Number(signal.factor))
    return apply("add", value, Number(signal.offset)) if signal.offset else value


def usable_range(signal: SignalSpec) -> tuple[float, float]:
    """The range outside which a reading is invalid, in its unit."""
    low, high = signal.ends
    if math.isfinite(low) and math.isfinite(high):
        slack = runtime_limits.BEYOND_RANGE * (high - low)
        low, high = low - slack, high + slack
    else:
        high = largest_reading(signal)
        low = -high
    first, last = sorted((signal.shown(low), signal.shown(high)))
    return first, last
