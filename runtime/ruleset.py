"""The ruleset: what the compiler hands to the runtime. Data only, SI inside."""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from runtime.plan import OPERATIONS, UNARY, Plan

FORMAT_VERSION = 1

UNCERTAINTIES = ("full scale", "reading", "value")
"""What the systematic uncertainty of a sensor is a share of, or a value."""


class RulesetRefused(Exception):
    """The file is no ruleset of this version; the message says what to do."""


@dataclass(frozen=True)
class SignalSpec:
    """A measured value: SI = reading * factor + offset.

    `kind` and `standard` give the systematic standard uncertainty (a share of full scale or of
    the reading, or a value in SI). `valid_from`, `valid_to` bound the range in which the equations
    were calibrated; below `minimum` nothing is judged.
    """

    id: str
    title: str
    unit: str
    factor: float
    offset: float
    kind: str
    standard: float
    full_scale: float | None
    lowest: float | None
    highest: float | None
    minimum: float | None
    valid_from: float | None
    valid_to: float | None
    is_input: bool
    reference: float


@dataclass(frozen=True)
class ColumnMap:
    """A column of a foreign file; SI = value * factor + offset."""

    signal: str
    column: str
    factor: float
    offset: float


@dataclass(frozen=True)
class UnitSpec:
    """A unit a recording may be written in; `dimension` are exponents of m, kg, s, K."""

    factor: float
    offset: float
    dimension: tuple[float, ...]


@dataclass(frozen=True)
class Guard:
    """A plan output that must be positive, and how to say so."""

    output: str
    text: str


@dataclass(frozen=True)
class ObserverSpec:
    """An estimate of the flow through a module; `signals` are all readings it depends on."""

    id: str
    module: str
    component: str
    equation: str
    signals: tuple[str, ...]
    guards: tuple[Guard, ...]
    misfit: float
    reference: float
    origin: str


@dataclass(frozen=True)
class Junction:
    """Flows balance here: those that leave `outlets` enter `inlets`."""

    outlets: tuple[str, ...]
    inlets: tuple[str, ...]


@dataclass(frozen=True)
class Term:
    """A signed observer in a residual."""

    observer: str
    sign: int


@dataclass(frozen=True)
class ResidualSpec:
    """A signed sum of observers that is zero in a healthy plant."""

    id: str
    module: str
    terms: tuple[Term, ...]
    text: str
    u: float


@dataclass(frozen=True)
class FaultSpec:
    """A hypothesis. `affects` lists the observers that it makes wrong."""

    id: str
    module: str
    fault: str
    title: str
    text: str
    action: str
    status: str
    lowest: float
    highest: float
    tolerance: float
    meaning: str
    affects: tuple[str, ...]
    origin: str


@dataclass(frozen=True)
class Cell:
    """A non-zero entry of the fault-symptom matrix at the reference point.

    `gain` is dR/dg (g: what the fault scales), `sensitivity` dR/dx in m3/s per unit of degree,
    `detectable` the degree at which the residual leaves its threshold. `forms` lists the rule
    forms that the plan holds as ``x:<form>:<fault>:<residual>``.
    """

    fault: str
    residual: str
    sign: int
    gain: float
    sensitivity: float
    detectable: float
    forms: tuple[str, ...]
    equation: str


@dataclass(frozen=True)
class AmbiguousGroup:
    """Faults that no residual tells apart, and the sensor that would."""

    faults: tuple[str, ...]
    kind: str
    advice: str


@dataclass(frozen=True)
class ParameterSpec:
    """A constant of a module with its origin; value and u in `unit`."""

    id: str
    value: float
    u: float
    unit: str
    origin: str


@dataclass(frozen=True)
class Ruleset:
    """Everything the runtime needs to judge recordings of one plant."""

    format_version: int
    plant: str
    title: str
    sources: str
    modules: Mapping[str, str]
    signals: tuple[SignalSpec, ...]
    columns: tuple[ColumnMap, ...]
    time_column: str
    units: Mapping[str, UnitSpec]
    observers: tuple[ObserverSpec, ...]
    junctions: tuple[Junction, ...]
    residuals: tuple[ResidualSpec, ...]
    faults: tuple[FaultSpec, ...]
    cells: tuple[Cell, ...]
    ambiguous: tuple[AmbiguousGroup, ...]
    unobserved: tuple[str, ...]
    parameters: tuple[ParameterSpec, ...]
    plan: Plan
    undo: Plan

    @cached_property
    def fault_by_id(self) -> Mapping[str, FaultSpec]:
        return {f.id: f for f in self.faults}

    @cached_property
    def observer_by_id(self) -> Mapping[str, ObserverSpec]:
        return {o.id: o for o in self.observers}

    @cached_property
    def signal_by_id(self) -> Mapping[str, SignalSpec]:
        return {s.id: s for s in self.signals}

    @cached_property
    def cells_of_fault(self) -> Mapping[str, tuple[Cell, ...]]:
        found: dict[str, list[Cell]] = {f.id: [] for f in self.faults}
        for cell in self.cells:
            found[cell.fault].append(cell)
        return {name: tuple(cells) for name, cells in found.items()}

    def to_json(self) -> str:
        """The ruleset as text; the same ruleset always gives the same bytes."""
        return _write({f.name: getattr(self, f.name) for f in dataclasses.fields(self)})


def _write(data: dict[str, Any]) -> str:
    """One line per table row: diffs of golden files stay readable."""
    lines = []
    for key, value in data.items():
        if isinstance(value, tuple) and value and dataclasses.is_dataclass(value[0]):
            rows = ",\n".join("  " + _dump(row) for row in value)
            lines.append(f"{json.dumps(key)}: [\n{rows}\n]")
        else:
            lines.append(f"{json.dumps(key)}: {_dump(value)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _dump(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, default=_fields)


def _fields(value: Any) -> dict[str, Any]:
    """Fields of a dataclass; `asdict` would copy every operation of a plan."""
    return {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}


def read_ruleset(path: Path) -> Ruleset:
    """Read a ruleset file; raises `RulesetRefused` if it is none, or of another version."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RulesetRefused(f"{path}: cannot be read as a ruleset ({error})") from None
    return parse_ruleset(data, str(path))


def parse_ruleset(data: Any, name: str = "ruleset") -> Ruleset:
    """Build a ruleset from its JSON data."""
    version = data.get("format_version") if isinstance(data, dict) else None
    if version != FORMAT_VERSION:
        raise RulesetRefused(
            f"{name}: format version {version!r}, but this runtime reads version "
            f"{FORMAT_VERSION}; compile the plant again"
        )
    try:
        ruleset: Ruleset = _build(Ruleset, data)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RulesetRefused(f"{name}: damaged ruleset ({error}); compile again") from None
    _verify(ruleset.plan, name)
    _verify(ruleset.undo, name)
    missing = next(_dangling(ruleset), None)
    if missing:
        raise RulesetRefused(f"{name}: damaged ruleset ({missing}); compile again")
    return ruleset


def _dangling(ruleset: Ruleset) -> Iterator[str]:
    """References to what the ruleset does not hold, and names it holds twice."""
    tables = {
        "signal": [s.id for s in ruleset.signals],
        "observer": [o.id for o in ruleset.observers],
        "residual": [r.id for r in ruleset.residuals],
        "fault": [f.id for f in ruleset.faults],
        "module": list(ruleset.modules),
        "output": list(ruleset.plan.outputs),
        "kind of uncertainty": list(UNCERTAINTIES),
    }
    for kind, names in tables.items():
        if len(set(names)) < len(names):
            yield f"a {kind} stands twice"
    known = {kind: frozenset(names) for kind, names in tables.items()}
    for kind, name in _references(ruleset):
        if name not in known[kind]:
            yield f"no {kind} '{name}'"


def _references(ruleset: Ruleset) -> Iterator[tuple[str, str]]:
    """Everything that one part of a ruleset says of another, as (kind, name)."""
    for signal in ruleset.signals:
        yield "kind of uncertainty", signal.kind
    for column in ruleset.columns:
        yield "signal", column.signal
    for observer in ruleset.observers:
        yield "module", observer.module
        yield from (("signal", s) for s in observer.signals)
        yield from (("output", g.output) for g in observer.guards)
    for junction in ruleset.junctions:
        yield from (("module", m) for m in (*junction.outlets, *junction.inlets))
    for residual in ruleset.residuals:
        yield from (("observer", t.observer) for t in residual.terms)
    for fault in ruleset.faults:
        yield "module", fault.module
        yield from (("observer", o) for o in fault.affects)
    for cell in ruleset.cells:
        yield "fault", cell.fault
        yield "residual", cell.residual


def _verify(plan: Plan, name: str) -> None:
    """A plan may only read what stands before it."""
    start = plan.first_operation
    for i, operation in enumerate(plan.operations, start):
        if not _legal(operation, i):
            raise RulesetRefused(f"{name}: damaged plan at operation {i - start}; compile again")
    end = start + len(plan.operations)
    if not all(type(i) is int and 0 <= i < end for i in plan.outputs.values()):
        raise RulesetRefused(f"{name}: damaged plan outputs; compile again")
    if not all(type(c) in (int, float) for c in plan.constants):
        raise RulesetRefused(f"{name}: damaged plan constants; compile again")


def _legal(operation: Any, number: int) -> bool:
    """Is this an operation that reads only values with smaller numbers?"""
    match operation:
        case (str(name), int(a), int(b)) if name in OPERATIONS:
            return 0 <= a < number and (name in UNARY or 0 <= b < number)
    return False


def _build(kind: Any, data: Any) -> Any:
    """Turn JSON data into the dataclass (or container) `kind`."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if dataclasses.is_dataclass(kind):
        hints = _hints(kind)
        return kind(**{name: _build(hints[name], data[name]) for name in hints})  # type: ignore[operator]
    if origin is tuple:
        if arguments[-1] is Ellipsis:
            return tuple(_build(arguments[0], item) for item in data)
        return tuple(data)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {str(k): _build(arguments[1], v) for k, v in data.items()}
    if origin in (types.UnionType, typing.Union):
        return data
    if kind is float:
        return float(data)
    return data


_HINTS: dict[Any, dict[str, Any]] = {}


def _hints(kind: Any) -> dict[str, Any]:
    if kind not in _HINTS:
        names = {f.name for f in dataclasses.fields(kind)}
        _HINTS[kind] = {n: h for n, h in typing.get_type_hints(kind).items() if n in names}
    return _HINTS[kind]
