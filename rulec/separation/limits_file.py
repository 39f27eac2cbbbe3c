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
    known = {s.id: s for s in ruleset.signals if s.is_input and s.id in ruleset.simulation.given}
    read = {}
    for name, part in reader.document.data["inputs"].items():
        path = ("inputs", name)
        if name not in known:
            reading = name in ruleset.signal_by_id
            message = f"'{name}' is no input" if reading else f"this plant has no input '{name}'"
            reader.report_key(path, "KB131", message, did_you_mean(name, known))
            continue
        found = _one(reader, path, part, known[name])
        if found is not None:
            read[name] = found
    return read


def _readings(reader: Reader, ruleset: Ruleset) -> dict[str, tuple[float, float]]:
    """Bounds of readings, SI."""
    known = {s.id: s for s in ruleset.signals if not s.is_input}
    read = {}
    for name, part in reader.document.data.get("readings", {}).items():
        path = ("readings", name)
        if name not in known:
            hint = did_you_mean(name, known)
            if name in ruleset.signal_by_id:
                hint = "limits of inputs stand under 'inputs'"
            reader.report_key(path, "KB134", f"'{name}' is no reading of this plant", hint)
            continue
        unit = _unit(reader, path, known[name])
        ends = (part.get("lowest", -math.inf), part.get("highest", math.inf))
        if not ends[0] < ends[1]:
            message = f"'lowest' {ends[0]:g} is not below 'highest' {ends[1]:g}"
            reader.report((*path, "lowest"), "KB055", message)
        elif unit is not None:
            read[name] = (unit.to_si(ends[0]), unit.to_si(ends[1]))
    return read


def _unit(reader: Reader, path: tuple[str, str], signal: SignalSpec) -> Unit | None:
    """The unit of limits; None, with a report, if it does not fit."""
    unit, own = reader.unit(*path, "unit"), reader.units.parse(signal.unit)
    if unit.dimension == UNKNOWN:
        return None
    if not unit.dimension.fits(own.dimension):
        message = f"'{path[-1]}' is in {own.text}; '{unit.text}' does not fit"
        reader.report((*path, "unit"), "KB073", message)
        return None
    return unit


def _one(
    reader: Reader, path: tuple[str, str], part: Mapping[str, Any], signal: SignalSpec
) -> Range | None:
    """The limits of an input in the unit of its sensor; None, with a report, for mistakes."""
    unit = _unit(reader, path, signal)
    if unit is None:
        return None
    if not part["lowest"] < part["highest"]:
        message = f"'lowest' {part['lowest']:g} is not below 'highest' {part['highest']:g}"
        reader.report((*path, "lowest"), "KB055", message)
        return None
    lowest, highest = (signal.shown(unit.to_si(part[key])) for key in ("lowest", "highest"))
    for bound in (signal.valid_to, signal.highest):
        if bound is not None and lowest > signal.shown(bound):
            _outside(reader, path, signal, "ends", bound)
            return None
    for bound in (signal.valid_from, signal.lowest, signal.minimum):
        if bound is not None and highest < signal.shown(bound):
            _outside(reader, path, signal, "begins", bound)
            return None
    return Range(
        signal=signal,
        lowest=lowest,
        highest=highest,
        rate=part.get("rate", math.inf) * unit.factor / signal.factor,
        hold=part.get("hold", 0.0),
        costs="costs" in part,
    )


def _outside(
    reader: Reader, path: tuple[str, str], signal: SignalSpec, does: str, bound: float
) -> None:
    message = f"the range of '{path[-1]}' {does} at {signal.shown(bound):.4g} {signal.unit}"
    reader.report_key(path, "KB133", message, "limits narrow the range of the plant")
