"""The routine that a central part may call: the estimates of a module with faults undone."""

from __future__ import annotations

from rulec_runtime.contract.ruleset import ObserverSpec, Ruleset

from rulec.algebra.graph import Graph
from rulec.export.identifiers import FLOW, Identifiers, Outputs
from rulec.export.program import (
    Expression,
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
from rulec.export.value_names import is_output_of, named_constants, put_into
from rulec.export.writer import Writer


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
