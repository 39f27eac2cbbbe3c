"""Read a file of limits, and check it against its plant."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.output.nearest import did_you_mean

from rulec.knowledge.read import read_alone
from rulec.knowledge.sources import table_of
from rulec.language.diagnostics import Refused
from rulec.language.reader import Reader
from rulec.language.units import UNKNOWN, Unit
from rulec.separation.allowed import Allowed, Range


def read_limits(path: Path, ruleset: Ruleset) -> Allowed:
    """Read the limits of a plant; raises `Refused` with every mistake in the file."""
    document, units = read_alone(path, "limits")
    reader = Reader(document, table_of(units, []), [])
    if document.data["limits"] != ruleset.plant:
        message = f"these are limits of '{document.data['limits']}', not of '{ruleset.plant}'"
        reader.report(("limits",), "KB130", message, "name the plant that is asked about")
        raise Refused(reader.found)
    inputs = _inputs(reader, ruleset)
    modules = document.data.get("modules", {})
    for name in modules:
        if name not in ruleset.modules:
            hint = did_you_mean(name, ruleset.modules)
            message = f"this plant has no module '{name}'"
            reader.report_key(("modules", name), "KB132", message, hint)
    readings = _readings(reader, ruleset)
    if reader.found:
        raise Refused(reader.found)
    return Allowed(inputs, frozenset(modules), readings)


def _inputs(reader: Reader, ruleset: Ruleset) -> dict[str, Range]:
    inputs = {s.id: s for s in ruleset.signals if s.is_input and s.id in ruleset.simulation.given}
    read = {}
    for name, part in reader.document.data["inputs"].items():
        path = ("inputs", name)
        if name not in inputs:
            reading = name in ruleset.signal_by_id
            message = f"'{name}' is no input" if reading else f"this plant has no input '{name}'"
            reader.report_key(path, "KB131", message, did_you_mean(name, inputs))
            continue
        signal = inputs[name]
        unit, ends = _ends(reader, path, part, signal)
        if ends is None:
            continue
        lowest, highest = map(signal.shown, ends)
        above = [("ends", b) for b in (signal.valid_to, signal.highest)]
        below = [("begins", b) for b in (signal.valid_from, signal.lowest, signal.minimum)]
        for does, bound in (*above, *below):
            if bound is None:
                continue
            shown = signal.shown(bound)
            if lowest > shown if does == "ends" else highest < shown:
                message = f"the range of '{name}' {does} at {shown:.4g} {signal.unit}"
                reader.report_key(path, "KB133", message, "limits narrow the range of the plant")
                break
        read[name] = Range(
            signal=signal,
            lowest=lowest,
            highest=highest,
            rate=part.get("rate", math.inf) * unit.factor / signal.factor,
            hold=part.get("hold", 0.0),
            costs="costs" in part,
        )
    return read


def _readings(reader: Reader, ruleset: Ruleset) -> dict[str, tuple[float, float]]:
    """Bounds of readings, SI."""
    readings = {s.id: s for s in ruleset.signals if not s.is_input}
    read = {}
    for name, part in reader.document.data.get("readings", {}).items():
        path = ("readings", name)
        if name not in readings:
            hint = did_you_mean(name, readings)
            if name in ruleset.signal_by_id:
                hint = "limits of inputs stand under 'inputs'"
            reader.report_key(path, "KB134", f"'{name}' is no reading of this plant", hint)
            continue
        _, ends = _ends(reader, path, part, readings[name])
        if ends is not None:
            read[name] = ends
    return read


def _ends(
    reader: Reader, path: tuple[str, str], part: Mapping[str, Any], signal: SignalSpec
) -> tuple[Unit, tuple[float, float] | None]:
    """The unit of limits and both ends, SI; None, with a report, for mistakes."""
    unit, own = reader.unit(*path, "unit"), reader.units.parse(signal.unit)
    low, high = part.get("lowest", -math.inf), part.get("highest", math.inf)
    sound = unit.dimension != UNKNOWN
    if sound and not unit.dimension.fits(own.dimension):
        message = f"'{path[-1]}' is in {own.text}; '{unit.text}' does not fit"
        reader.report((*path, "unit"), "KB073", message)
        sound = False
    if not low < high:
        message = f"'lowest' {low:g} is not below 'highest' {high:g}"
        reader.report((*path, "lowest"), "KB055", message)
        sound = False
    return unit, (unit.to_si(low), unit.to_si(high)) if sound else None
