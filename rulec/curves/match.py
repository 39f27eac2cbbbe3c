"""Which column of a sheet is which reading of a module type, and what can be derived from them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.output.terminal import one_line
from scipy.constants import g

from rulec.algebra.graph import Graph
from rulec.curves.limits import SHEET_DENSITY
from rulec.curves.sheet import Column, CurveRefused, role_of, unit_of
from rulec.knowledge.check_dimensions import dimensions_of
from rulec.knowledge.module_type import ModuleType
from rulec.language.units import NONE, VOLUME_FLOW, Dimension, UnitTable
from rulec.passes.lower import ClosedNames, lower_tree

FLOW = "Q"
"""The flow of the observers, where no signal of the type measures one."""

_LENGTH = Dimension.of({"m": 1})
_DENSITY = Dimension.of({"kg": 1, "m": -3})
_PRESSURE = Dimension.of({"kg": 1, "m": -1, "s": -2})
_POWER = Dimension.of({"kg": 1, "m": 2, "s": -3})
_TORQUE = Dimension.of({"kg": 1, "m": 2, "s": -2})
_SPEED = Dimension.of({"s": -1})
_GIVEN = re.compile(
    r"\s*(?P<name>\w+)\s*=\s*(?P<number>[-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(?P<unit>.*)"
)


@dataclass(frozen=True)
class Points:
    """Readings by signal (or `FLOW`), each shape (n,), SI; `notes` state the assumptions."""

    readings: Mapping[str, Array]
    notes: tuple[str, ...]


def given_values(
    texts: Iterable[str], kind: ModuleType, units: UnitTable
) -> tuple[dict[str, float], dict[str, float]]:
    """Constant signals and parameters from ``NAME=VALUE UNIT`` texts, SI. Raises `CurveRefused`."""
    signals: dict[str, float] = {}
    parameters: dict[str, float] = {}
    for text in texts:
        part = _GIVEN.fullmatch(text)
        shown = one_line(text)[:60]
        if part is None:
            raise CurveRefused(f"--at '{shown}': write NAME=VALUE UNIT, as in 'n=2900 rpm'")
        name = part["name"]
        own = kind.signals.get(name) or kind.parameters.get(name)
        if own is None:
            known = ", ".join((*kind.signals, *kind.parameters))
            raise CurveRefused(f"--at '{shown}': {kind.name} has no '{name}'; it has {known}")
        unit = unit_of(part["unit"] or own.unit.text, units)
        if unit is None or not unit.dimension.fits(own.unit.dimension):
            raise CurveRefused(f"--at '{shown}': {name} is in {own.unit.text}")
        try:
            value = unit.to_si(float(part["number"]))
        except ValueError:
            raise CurveRefused(f"--at '{shown}': '{part['number']}' is no number") from None
        (signals if name in kind.signals else parameters)[name] = value
    return signals, parameters


def points_of(
    kind: ModuleType, columns: Sequence[Column], constants: Mapping[str, float]
) -> Points:
    """The readings of a sheet. Raises `CurveRefused` if a column could be two of them."""
    count = len(columns[0].values)
    readings = {name: np.full(count, value) for name, value in constants.items()}
    wanted = wanted_by(kind)
    rest: list[Column] = []
    notes: list[str] = []
    by_name = {name.lower(): name for name in kind.signals}
    for column in columns:
        name = by_name.get(column.name.lower())
        if name is None:
            rest.append(column)
            continue
        signal = kind.signals[name]
        if not column.unit.dimension.fits(signal.unit.dimension):
            raise CurveRefused(
                f"column '{column.name}' is in {column.unit.text}, but {name} is measured in "
                f"{signal.unit.text}; are two columns swapped?"
            )
        readings[name] = column.values
    plain = [column for column in rest if not role_of(column.name)]
    for column in plain:
        fits = [n for n, d in wanted.items() if n not in readings and column.unit.dimension.fits(d)]
        alike = [c for c in plain if c.unit.dimension.fits(column.unit.dimension)]
        if len(fits) == 1 and len(alike) == 1:
            readings[fits[0]] = column.values
            known = kind.signals.get(fits[0])
            if known is not None:
                what = f"{known.name}, {known.quantity}," if known.quantity else known.name
                notes.append(f"{what} from column '{one_line(column.name)[:40]}'")
        elif fits:
            names = ", ".join(one_line(c.name)[:40] for c in alike)
            raise CurveRefused(
                f"{names}: each could be {' or '.join(fits)}; rename the right ones so with "
                "--columns, and leave out the others"
            )
    taken = {id(values) for values in readings.values()}
    points = _derived(readings, [c for c in rest if id(c.values) not in taken], wanted)
    return Points(points.readings, (*notes, *points.notes))


def explained(
    laws: Sequence[Law], readings: Mapping[str, Array], wanted: Mapping[str, Dimension]
) -> list[tuple[Law, str]]:
    """Laws, each with the reading that it predicts from others in the sheet.

    If several predict a reading, the last of the group that comes first counts: it builds on the
    others.
    """
    found: dict[str, Law] = {}
    for law in laws:
        fits = [
            name
            for name in readings
            if name not in law.reads and law.dimension.fits(wanted.get(name, VOLUME_FLOW))
        ]
        if len(fits) == 1 and law.reads <= readings.keys() and law.reads:
            before = found.get(fits[0])
            if before is None or law.group == before.group:
                found[fits[0]] = law
    return [(law, name) for name, law in found.items()]


def wanted_by(kind: ModuleType) -> dict[str, Dimension]:
    """Dimensions of the signals that observers read, and of the flow."""
    read = {n for o in kind.observers.values() for n in kind.names_through(o.expression)}
    wanted = {n: s.unit.dimension for n, s in kind.signals.items() if n in read}
    return wanted if VOLUME_FLOW in wanted.values() else {**wanted, FLOW: VOLUME_FLOW}


def _derived(
    readings: dict[str, Array], rest: Sequence[Column], wanted: Mapping[str, Dimension]
) -> Points:
    """Fill in missing readings: pressure from head, power from efficiency, torque from power."""
    notes: list[str] = []
    count = len(next(iter(readings.values()))) if readings else len(rest[0].values)

    def lacking(dimension: Dimension) -> str | None:
        names = [n for n, d in wanted.items() if d == dimension]
        return names[0] if len(names) == 1 and names[0] not in readings else None

    def known(dimension: Dimension) -> Array | None:
        found = [readings[n] for n, d in wanted.items() if d == dimension and n in readings]
        return found[0] if len(found) == 1 else None

    def column(dimension: Dimension, role: str = "") -> Column | None:
        fits = [c for c in rest if c.unit.dimension == dimension and role_of(c.name) == role]
        return fits[0] if len(fits) == 1 else None

    usual = f"{SHEET_DENSITY:g} kg/m3, as of the test liquid of ISO 9906; else give --at"
    if (name := lacking(_DENSITY)) is not None:
        readings[name] = np.full(count, SHEET_DENSITY)
        notes.append(f"{name} taken as {usual}")
    head = column(_LENGTH)
    if head is not None and (name := lacking(_PRESSURE)) is not None:
        density = known(_DENSITY)
        if density is None:
            density = np.full(count, SHEET_DENSITY)
            notes.append(f"density taken as {usual}")
        readings[name] = density * g * head.values
        notes.append(f"{name} from column '{one_line(head.name)[:40]}', times density and g")
    flow, pressure = known(VOLUME_FLOW), known(_PRESSURE)
    efficiency, power, brake = column(NONE, "efficiency"), column(_POWER), column(_POWER, "shaft")
    shaft, origin = None if power is None else power.values, ""
    if shaft is None and brake is not None:
        shaft, title = brake.values, one_line(brake.name)[:40]
        origin = f"power at the shaft, from column '{title}'; its drive draws more"
    elif shaft is None and efficiency and flow is not None and pressure is not None:
        with np.errstate(all="ignore"):
            shaft = np.where(efficiency.values > 0.0, flow * pressure / efficiency.values, np.nan)
        origin = "power at the shaft, from flow, head and efficiency; without flow it says nothing"
    speed = known(_SPEED)
    if shaft is not None and (name := lacking(_POWER)) is not None:
        readings[name] = shaft
        notes += [f"{name} taken as the {origin}"] if origin else []
    elif shaft is not None and speed is not None and (name := lacking(_TORQUE)) is not None:
        readings[name] = shaft / (2.0 * np.pi * speed)
        notes += [f"{name} from power and speed", *([origin] if origin else [])]
    return Points(readings, tuple(notes))


@dataclass(frozen=True)
class Law:
    """A definition or an observer that predicts a column.

    `reads` are its signals, `free` the parameters that a fit may change.
    """

    group: str
    name: str
    dimension: Dimension
    reads: frozenset[str]
    free: tuple[str, ...]


def laws_of(kind: ModuleType) -> list[Law]:
    """Laws that depend on signals and parameters alone, definitions first."""
    dimensions = dimensions_of(kind)
    parts = {
        **{("definitions", d.name): d.expression for d in kind.definitions.values()},
        **{("observers", o.name): o.expression for o in kind.observers.values()},
    }
    found = []
    for (group, name), expression in parts.items():
        is_law = group != "definitions" or (group, name) in kind.laws()
        names = kind.names_through(expression)
        equations = list(kind.with_definitions(expression))
        asks = any(next(e.gathered(), next(e.properties(), None)) for e in equations)
        free = tuple(p.name for p in kind.parameters.values() if p.fit and p.name in names)
        if is_law and free and not asks and not names & kind.states.keys():
            gives = dimensions[name] if group == "definitions" else VOLUME_FLOW
            reads = frozenset(names & kind.signals.keys())
            found.append(Law(group, name, gives, reads, free))
    return found


def plan_of(kind: ModuleType, laws: list[Law]) -> Plan:
    """A plan with the laws as outputs and signals and parameters as inputs, by name; all SI."""
    graph = Graph((*kind.signals, *kind.parameters))
    names = ClosedNames(graph, {d.name: d.expression for d in kind.definitions.values()})
    for law in laws:
        parts = kind.definitions if law.group == "definitions" else kind.observers
        graph.outputs[law.name] = lower_tree(graph, parts[law.name].expression.tree, names)
    return graph.plan()
