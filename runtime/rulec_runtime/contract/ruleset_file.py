"""Read a ruleset file; refuse other files, other versions and damaged ones.

A ruleset decides what an operator is told, so it is used as compiled or not at all: its digest
reveals every change. Types and references are checked as well, whoever made the digest.
"""

import dataclasses
import functools
import types
import typing
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from rulec_runtime.contract.fault_frequency import FREQUENCY_ODDS
from rulec_runtime.contract.plan import OPERATIONS, UNARY, Plan
from rulec_runtime.contract.ruleset import FORMAT_VERSION, UNCERTAINTIES, Ruleset, Simulation
from rulec_runtime.output.json_file import DIGEST, Damaged, digest_of, read_json
from rulec_runtime.output.refusal import Refusal


class RulesetRefused(Refusal):
    """The file is no ruleset of this version; the message says what to do."""


def read_ruleset(path: Path) -> Ruleset:
    """Read a ruleset file; raises `RulesetRefused` if it is none, or of another version."""
    try:
        data = read_json(path)
    except IsADirectoryError:
        raise RulesetRefused(f"{path}: a folder; give the file that rulec compile wrote") from None
    except OSError as error:
        raise RulesetRefused(f"{path}: cannot be read ({error.strerror})") from None
    except Damaged as error:
        raise RulesetRefused(f"{path}: this is no ruleset ({error})") from None
    _refuse_version(data, str(path))
    if data.get(DIGEST) != digest_of(data):
        raise RulesetRefused(
            f"{path}: this ruleset was changed or damaged after it was compiled; compile again "
            "(changes belong into the plant's files)"
        )
    return parse_ruleset(data, str(path))


def _refuse_version(data: Any, name: str) -> None:
    version = data.get("format_version") if isinstance(data, dict) else None
    if version != FORMAT_VERSION:
        raise RulesetRefused(
            f"{name}: format version {str(version)[:30]}, but this runtime reads version "
            f"{FORMAT_VERSION}; compile the plant again"
        )


def parse_ruleset(data: Any, name: str = "ruleset") -> Ruleset:
    """Build a ruleset from its JSON data."""
    _refuse_version(data, name)
    try:
        ruleset: Ruleset = built(Ruleset)(data)
    except Damaged as error:
        raise RulesetRefused(f"{name}: damaged ruleset ({error}); compile again") from None
    _verify(ruleset.plan, name)
    _verify(ruleset.undo, name)
    if ruleset.dynamics is not None:
        _verify(ruleset.dynamics.plan, name)
    missing = next(_dangling(ruleset), None)
    if missing:
        raise RulesetRefused(f"{name}: damaged ruleset ({missing}); compile again")
    return ruleset


def _dangling(ruleset: Ruleset) -> Iterator[str]:
    """References to what the ruleset does not hold, and duplicate names."""
    tables = {
        "signal": [s.id for s in ruleset.signals],
        "observer": [o.id for o in ruleset.observers],
        "residual": [r.id for r in ruleset.residuals],
        "fault": list(ruleset.fault_by_id),
        "regime": [r.id for r in ruleset.regimes],
        "module": list(ruleset.modules),
        "output": list(ruleset.plan.outputs),
        "kind of uncertainty": list(UNCERTAINTIES),
        "frequency": list(FREQUENCY_ODDS),
    }
    for kind, names in tables.items():
        if len(set(names)) < len(names):
            yield f"a {kind} stands twice"
    ids = {kind: frozenset(names) for kind, names in tables.items()}
    for kind, name in _references(ruleset):
        if name not in ids[kind]:
            yield f"no {kind} '{name}'"
    if "s" not in ruleset.units:
        yield "no unit 's'"
    factors = [signal.factor for signal in ruleset.signals]
    factors += [column.factor for column in ruleset.columns]
    if 0.0 in [*factors, *(unit.factor for unit in ruleset.units.values())]:
        yield "a unit of size 0"
    yield from _disordered(ruleset.simulation)


def _disordered(simulation: Simulation) -> Iterator[str]:
    """Steps of the simulation that cannot run in this order."""
    found: set[str] = set()
    for number, step in enumerate(simulation.steps, 1):
        if len(step.zeros) != len(step.readings):
            yield f"step {number} of the simulation has not as many equations as readings"
        terms = {name for part in (*step.zeros, *step.flows.values()) for name in part}
        if not {name for name in terms if "." not in name} <= found:
            yield f"step {number} of the simulation needs a flow that is not found yet"
        if found & {*step.readings, *step.flows}:
            yield f"step {number} of the simulation finds something for the second time"
        found |= {*step.readings, *step.flows}


def _references(ruleset: Ruleset) -> Iterator[tuple[str, str]]:
    """All references from one part of a ruleset to another, as (kind, name)."""
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
    for fault in (*ruleset.faults, *ruleset.unlisted):
        yield "module", fault.module
        yield "frequency", fault.frequency
        yield from (("observer", o) for o in fault.affects)
        yield from (("signal", s) for s in fault.scales)
    for change in ruleset.liquid:
        yield "frequency", change.fault.frequency
        yield from (("observer", o) for o in change.fault.affects)
        yield from (("signal", s) for s in (*change.fault.scales, *change.thermometers))
    others = (*ruleset.unlisted_cells, *(c for change in ruleset.liquid for c in change.cells))
    for cell in (*ruleset.cells, *others):
        yield "fault", cell.fault
        yield "residual", cell.residual
    for regime in ruleset.regimes:
        yield "module", regime.module
        yield from (("signal", c.signal) for c in regime.when if c.signal)
        margins = [c.margin for c in regime.when if not c.signal]
        yield from (("output", f"{kind}:{m}") for m in margins for kind in ("margin", "u_margin"))
    yield from _references_of_steps(ruleset.simulation)
    if ruleset.dynamics is not None:
        yield from (("signal", s) for s in (*ruleset.dynamics.inputs, *ruleset.dynamics.outputs))
        yield from (("fault", f) for f in ruleset.dynamics.faults)


def _references_of_steps(simulation: Simulation) -> Iterator[tuple[str, str]]:
    yield from (("signal", name) for name in simulation.given)
    for step in simulation.steps:
        yield from (("signal", name) for name in step.readings)
        yield from (("module", name) for name in step.flows)
        for terms in (*step.zeros, *step.flows.values()):
            yield from (("observer" if "." in name else "module", name) for name in terms)


def _verify(plan: Plan, name: str) -> None:
    """A plan may only read what comes before it."""
    start = plan.first_operation
    for i, (operation, a, b) in enumerate(plan.operations, start):
        known = operation in OPERATIONS
        if not (known and 0 <= a < i and (operation in UNARY or 0 <= b < i)):
            raise RulesetRefused(f"{name}: damaged plan at operation {i - start}; compile again")
    end = start + len(plan.operations)
    if not all(type(i) is int and 0 <= i < end for i in plan.outputs.values()):
        raise RulesetRefused(f"{name}: damaged plan outputs; compile again")
    if not all(type(c) in (int, float) for c in plan.constants):
        raise RulesetRefused(f"{name}: damaged plan constants; compile again")


@functools.cache
def built(kind: Any) -> Callable[[Any], Any]:
    """A function that turns JSON data into `kind`; types are inspected once, not per value. It
    raises `Damaged` where the data do not fit."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if dataclasses.is_dataclass(kind):
        return _group_builder(kind)
    if origin is tuple and arguments[-1] is not Ellipsis:
        return _row_builder(arguments)
    if origin is tuple:
        item = built(arguments[0])
        return lambda data: tuple(map(item, _checked(data, list, "a list")))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        value = built(arguments[1])
        return lambda data: {n: value(v) for n, v in _checked(data, dict, "a group").items()}
    if origin is typing.Literal:
        return _choice_builder(arguments)
    if origin in (types.UnionType, typing.Union):
        whole = built(next(a for a in arguments if a is not types.NoneType))
        return lambda data: None if data is None else whole(data)
    if kind is float:
        number = (int, float)
        return lambda data: (
            data if type(data) is float else float(_checked(data, number, "a number"))
        )
    if kind in _WORDS:
        return lambda data: data if type(data) is kind else _checked(data, kind, _WORDS[kind])
    return lambda data: data


def _group_builder(kind: Any) -> Callable[[Any], Any]:
    fields, hints = dataclasses.fields(kind), typing.get_type_hints(kind)
    builders = {f.name: built(hints[f.name]) for f in fields}
    # A file of the same version, but an older tool, may lack these.
    optional = {f.name for f in fields if f.default is not dataclasses.MISSING}

    def build(data: Any) -> Any:
        _checked(data, dict, "a group")
        missing = [n for n in builders if n not in data and n not in optional]
        if missing:
            raise Damaged(f"no '{missing[0]}'")
        return kind(**{n: b(data[n]) for n, b in builders.items() if n in data})

    return build


def _row_builder(kinds: tuple[Any, ...]) -> Callable[[Any], Any]:
    builders = [built(kind) for kind in kinds]
    plain = kinds if all(kind in _WORDS for kind in kinds) else None

    def build(data: Any) -> Any:
        _checked(data, list, "a list")
        # Plans have hundreds of thousands of rows: rows of plain values are checked in one go.
        if (*map(type, data),) == plain:
            return tuple(data)
        if len(data) != len(builders):
            raise Damaged(f"{len(data)} entries where {len(builders)} belong")
        return tuple([one(item) for one, item in zip(builders, data, strict=True)])

    return build


def _choice_builder(choices: tuple[str, ...]) -> Callable[[Any], Any]:
    def build(data: Any) -> Any:
        if data not in choices:
            raise Damaged(f"{str(data)[:30]!r} where one of {', '.join(choices)} belongs")
        return data

    return build


_WORDS: dict[Any, str] = {str: "text", int: "a whole number", bool: "true or false"}


def _checked(data: Any, kind: Any, what: str) -> Any:
    if not isinstance(data, kind) or (isinstance(data, bool) and kind is not bool):
        raise Damaged(f"{str(data)[:30]!r} where {what} belongs")
    return data
