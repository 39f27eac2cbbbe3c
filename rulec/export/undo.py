"""The routine that a central part may ask: the estimates of a module with faults undone."""

from __future__ import annotations

from rulec_runtime.contract.ruleset import Ruleset

from rulec.export.identifiers import Identifiers
from rulec.export.parameters import named_constants
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
from rulec.export.readings import checked, reading_of
from rulec.export.specialised import graph_of, put_into
from rulec.export.writer import Writer

FLOW = "m3/s"


def undo_routine(ruleset: Ruleset, module: str) -> Routine:
    """Estimates as functions of the degrees of all faults that reach them."""
    names = Identifiers()
    observers = [o for o in ruleset.observers if o.module == module]
    own = {o.id for o in observers}
    wanted = [n for n in ruleset.undo.outputs if n.split(":")[1] in own]
    part = ruleset.undo.select(tuple(wanted)).narrowed()
    signals = [ruleset.signal_by_id[n] for n in part.inputs if not n.startswith("x:")]
    readings = {s.id: reading_of(s, module, names) for s in signals}
    degrees = {n: _degree(ruleset, module, n, names) for n in part.inputs if n.startswith("x:")}
    graph = graph_of(part.inputs)
    graph.outputs.update(put_into(graph, part, wanted, {}))
    plan = graph.plan()
    parameters = named_constants(ruleset, module, plan.constants, names)
    given: dict[str, Expression] = {n: r.si for n, r in readings.items()}
    given |= {n: Name(d.name) for n, d in degrees.items()}
    writer = Writer(plan, given, {p.value: Name(p.name) for p in parameters}, names)
    sections = [checked(readings.values())]
    outputs: list[Variable] = []
    for observer in observers:
        short = observer.id.partition(".")[2]
        conditions: list[Expression] = [readings[s].ok for s in observer.signals if s in readings]
        flow = writer.named(f"q:{observer.id}", names.new(f"Q_{short}"))
        conditions += writer.conditions(f"q:{observer.id}")
        for name in wanted:
            if name.startswith(f"dq:{observer.id}:"):
                fault = name.split(":", 2)[2]
                what = f"slope of {short} by the degree of {fault}"
                target = names.new(f"{short}_by_{fault.removeprefix(f'{module}.')}")
                outputs.append(Variable(target, name, "real", f"{FLOW} per degree", what))
                writer.named(name, target)
                conditions += writer.conditions(name)
        statements = list(writer.taken())
        valid = names.new(f"{short}_valid")
        outputs.append(Variable(valid, f"valid:{observer.id}", "bool", "", f"{short} may be used"))
        statements.append(Statement(valid, every(conditions), "bool"))
        name = names.new(short)
        text = f"{short} with the faults undone; 0 where not valid"
        outputs.append(Variable(name, f"q:{observer.id}", "real", FLOW, text))
        statements.append(Statement(name, apply("select", Name(valid), flow, Number(0.0))))
        sections.append(Section(f"{observer.id} with faults undone", tuple(statements)))
    used, read = without_unused(sections, outputs)
    return Routine(
        name="undo",
        text="The same estimates with faults undone, as functions of their degrees: for a central "
        "part that asks. A degree of 0 is no fault.",
        inputs=(*(v for r in readings.values() for v in (r.value, r.good)), *degrees.values()),
        parameters=tuple(p for p in parameters if p.name in read),
        sections=used,
        outputs=tuple(outputs),
    )


def _degree(ruleset: Ruleset, module: str, name: str, names: Identifiers) -> Variable:
    """A degree as input."""
    fault = ruleset.fault_by_id[name.removeprefix("x:")]
    short = names.new(f"x_{fault.id.removeprefix(f'{module}.')}")
    return Variable(short, name, "real", fault.unit or "1", f"degree of {fault.id}")
