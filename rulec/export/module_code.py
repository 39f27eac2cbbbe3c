"""All code of a plant: two routines for each module that estimates a flow, and their wiring."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace

from rulec_runtime.contract.ruleset import ObserverSpec, Ruleset
from rulec_runtime.output.csv_cell import row_of
from rulec_runtime.output.json_file import DIGEST

from rulec.algebra.graph import Graph
from rulec.export.identifiers import FLOW, Identifiers, Outputs
from rulec.export.observe import observe_routine
from rulec.export.program import (
    Expression,
    ModuleCode,
    Name,
    Number,
    Routine,
    Section,
    Statement,
    Variable,
    apply,
    every,
    without_unused,
)
from rulec.export.readings import Reading, checked, reading_of
from rulec.export.value_names import is_output_of, listed_undo, named_constants, put_into
from rulec.export.writer import Writer


def code_of(ruleset: Ruleset) -> tuple[ModuleCode, ...]:
    """Code of each module that estimates its flow, in the plant's order."""
    digest = json.loads(ruleset.to_json())[DIGEST]
    ruleset = replace(ruleset, undo=listed_undo(ruleset))
    names = Identifiers(frozenset())  # suffixes keep them from being reserved words
    found = []
    for module in ruleset.modules:
        if any(o.module == module for o in ruleset.observers):
            routines = (observe_routine(ruleset, module), undo_routine(ruleset, module))
            head = _head(ruleset, module, digest)
            found.append(ModuleCode(module, names.new(module), head, routines))
    return tuple(found)


def _head(ruleset: Ruleset, module: str, digest: str) -> tuple[str, ...]:
    """The head of the files of a module; the same ruleset gives the same lines."""
    own = [o for o in ruleset.observers if o.module == module]
    files = dict.fromkeys(o.origin.partition(":")[0] for o in own)
    return (
        f"Module {module} ({ruleset.modules[module]}) of plant {ruleset.plant}",
        f"Type: {', '.join(files)}",
        f"Ruleset: format {ruleset.format_version}, sha256 {digest}",
        f"Sources: {ruleset.sources}",
        *(f"Knowledge: {k.name} {k.version} {k.digest}" for k in ruleset.knowledge),
        "Written by rulec export; change the sources, not this file.",
        "Inputs are in the units named beside them, outputs in SI (flows in m3/s).",
        "",
        "Estimates and their sources:",
        *(f"  {o.equation}   ({o.origin})" for o in own),
    )


def wiring_csv(codes: Iterable[ModuleCode]) -> str:
    """A row per variable, for those who wire controllers and central part; `id` is its column in
    the results file, or the signal that it reads."""
    header = ("module", "routine", "direction", "name", "type", "unit", "id", "meaning")
    rows = [row_of(header)]
    for code in codes:
        for routine in code.routines:
            for way, variables in (("in", routine.inputs), ("out", routine.outputs)):
                for v in variables:
                    kind = {"real": "LREAL", "bool": "BOOL"}[v.kind]
                    place = (code.module, routine.name, way, v.name, kind)
                    rows.append(row_of([*place, v.unit, v.id, v.text]))
    return "\n".join(rows) + "\n"


def undo_routine(ruleset: Ruleset, module: str) -> Routine:
    """Estimates as functions of the degrees of all faults that affect them."""
    observers = [o for o in ruleset.observers if o.module == module]
    own = {o.id for o in observers}
    wanted = [n for n in ruleset.undo.outputs if is_output_of(n, own, ("q", "dq"))]
    part = ruleset.undo.select(tuple(wanted)).narrowed()
    names = Identifiers()
    outputs = Outputs(names)
    signals = [ruleset.signal_by_id[n] for n in part.inputs if not n.startswith("x:")]
    readings = {s.id: reading_of(s, module, names) for s in signals}
    degrees = {n: _degree(ruleset, module, n, names) for n in part.inputs if n.startswith("x:")}
    graph = Graph(dict.fromkeys(part.inputs))
    graph.outputs.update(put_into(graph, part, wanted, {}))
    plan = graph.plan()
    parameters = named_constants(ruleset, module, plan.constants, names)
    given: dict[str, Expression] = {n: r.si for n, r in readings.items()}
    given |= {n: Name(d.name) for n, d in degrees.items()}
    writer = Writer(plan, given, {p.value: Name(p.name) for p in parameters}, names)
    sections = [checked(readings.values())]
    for observer in observers:
        own_readings = [readings[s] for s in observer.signals if s in readings]
        sections.append(_section(observer, own_readings, wanted, writer, outputs))
    used, read = without_unused(sections, outputs.variables)
    return Routine(
        name="undo",
        text="The same estimates with faults undone, as functions of their degrees: for a central "
        "part that asks. A degree of 0 is no fault.",
        inputs=(*(v for r in readings.values() for v in (r.value, r.good)), *degrees.values()),
        parameters=tuple(p for p in parameters if p.name in read),
        sections=used,
        outputs=tuple(outputs.variables),
    )


def _section(
    observer: ObserverSpec,
    readings: list[Reading],
    wanted: list[str],
    writer: Writer,
    outputs: Outputs,
) -> Section:
    """One estimate, its slopes with respect to the degrees, and its validity."""
    short, key = observer.id.partition(".")[2], f"q:{observer.id}"
    flow = writer.named(key, outputs.names.new(f"Q_{short}"))
    conditions: list[Expression] = [*(r.ok for r in readings), *writer.conditions(key)]
    for name in wanted:
        if name.startswith(f"dq:{observer.id}:"):
            fault = name.split(":", 2)[2]
            bare = fault.removeprefix(f"{observer.module}.")
            what = f"slope of {short} by the degree of {fault}"
            unit = f"{FLOW} per degree"
            writer.named(name, outputs.number(f"{short}_by_{bare}", name, what, unit))
            conditions += writer.conditions(name)
    valid = outputs.flag(f"{short}_valid", f"valid:{observer.id}", f"{short} may be used")
    text = f"{short} with the faults undone; 0 where not valid"
    value = outputs.number(short, key, text)
    statements = (
        *writer.taken(),
        Statement(valid, every(conditions), "bool"),
        Statement(value, apply("select", Name(valid), flow, Number(0.0))),
    )
    return Section(f"{observer.id} with faults undone", statements)


def _degree(ruleset: Ruleset, module: str, name: str, names: Identifiers) -> Variable:
    fault = ruleset.fault_by_id[name.removeprefix("x:")]
    short = names.new(f"x_{fault.id.removeprefix(f'{module}.')}")
    return Variable(short, name, "real", fault.unit or "1", f"degree of {fault.id}")
