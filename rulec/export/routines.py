"""The two routines of a module: `observe` estimates at an operating point, with everything that the
central part needs; `undo` estimates without faults of given degrees."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import rulec_runtime.limits as runtime_limits
from rulec_runtime.contract.plan import Plan
from rulec_runtime.contract.ruleset import ObserverSpec, ResidualSpec, Ruleset, SignalSpec
from rulec_runtime.recordings.recording_file import largest_reading

from rulec.algebra.graph import Graph
from rulec.export.identifiers import FLOW, Identifiers, Outputs
from rulec.export.program import (
    Apply,
    Expression,
    Name,
    Number,
    Parameter,
    Routine,
    Section,
    Statement,
    Variable,
    apply,
    every,
    total,
    without_unused,
)
from rulec.export.value_names import hints_of, is_output_of, named_constants, put_into
from rulec.export.writer import Writer


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


class Observe:
    """Builds the routine that estimates the flow through a module at given readings; `flow`,
    `slopes` (by error) and `valid` are names per observer."""

    def __init__(self, ruleset: Ruleset, module: str) -> None:
        self.ruleset, self.module = ruleset, module
        self.observers = [o for o in ruleset.observers if o.module == module]
        self.names = Identifiers()
        self.outputs = Outputs(self.names)
        ids = {s for o in self.observers for s in o.signals}
        signals = [s for s in ruleset.signals if s.id in ids]
        self.readings = {s.id: reading_of(s, module, self.names) for s in signals}
        self.noise = {s.id: self._noise(s) for s in signals}
        self.u = {n: Name(self.names.new(f"u_{r.value.name}")) for n, r in self.readings.items()}
        self.flow: dict[str, Name] = {}
        self.slopes: dict[str, dict[str, Name]] = {}
        self.valid: dict[str, Name] = {}
        self.writer, self.constants = self._writer(self._plan())

    def routine(self) -> Routine:
        """All sections in order."""
        readings = list(self.readings.values())
        sections = [checked(readings), self._uncertainties()]
        sections += [self._observer(o) for o in self.observers]
        own = {o.id for o in self.observers}
        residuals = self.ruleset.residuals
        sections += [
            self._residual(r) for r in residuals if own.issuperset(t.observer for t in r.terms)
        ]
        whole = Routine(
            name="observe",
            text="Estimates of the flow through the module at one operating point: call it with "
            "mean readings while the plant is settled.",
            inputs=(*(v for r in readings for v in (r.value, r.good)), *self.noise.values()),
            parameters=self.constants,
            sections=tuple(sections),
            outputs=tuple(self.outputs.variables),
        )
        return without_unused(whole)

    def _noise(self, signal: SignalSpec) -> Variable:
        name = self.readings[signal.id].value.name
        text = f"standard uncertainty of the mean {name} by its noise"
        wanted = self.names.new(f"{name}_noise")
        return Variable(wanted, f"noise:{signal.id}", "real", signal.unit, text)

    def _plan(self) -> Plan:
        """Flows, guards and slopes in one plan; slopes by degrees are those without faults."""
        plan, undo = self.ruleset.plan, self.ruleset.undo
        own = {o.id for o in self.observers}
        graph = Graph(dict.fromkeys(self.readings))
        for part, kinds, known in (
            (plan, ("q", "guard", "s"), {n: 1.0 for n in plan.inputs if n.startswith("u:")}),
            (undo, ("dq",), {n: 0.0 for n in undo.inputs if n.startswith("x:")}),
        ):
            wanted = [n for n in part.outputs if is_output_of(n, own, kinds)]
            put_into(graph, part, wanted, known)
        return graph.plan()

    def _writer(self, plan: Plan) -> tuple[Writer, tuple[Parameter, ...]]:
        """A writer with the names of readings, parameters and equations; and the parameters."""
        parameters = named_constants(self.ruleset, self.module, plan.constants, self.names)
        by_value = {p.value: Name(p.name) for p in parameters}
        known = {
            i: self._short(n) for i, n in enumerate(plan.inputs) if n.startswith(f"{self.module}.")
        }
        for i, value in enumerate(plan.constants, len(plan.inputs)):
            if value in by_value:
                known[i] = by_value[value].text
        hints: dict[int, str] = {}
        for observer in self.observers:
            hints |= hints_of(plan, observer, known)
        given = {n: self.readings[n].si for n in plan.inputs}
        return Writer(plan, given, by_value, self.names, hints), parameters

    def _short(self, name: str) -> str:
        """A name without its module."""
        return name.removeprefix(f"{self.module}.").removeprefix(f"{self.module}#")

    def _uncertainties(self) -> Section:
        """Standard uncertainties of the readings, SI, and whether they are in calibrated ranges."""
        statements = list(self.writer.taken())
        for name, reading in self.readings.items():
            statements += of_reading(reading, self.noise[name], self.u[name].text, self.outputs)
        return Section("Uncertainties of the readings", tuple(statements))

    def _observer(self, observer: ObserverSpec) -> Section:
        """One estimate: flow, slopes, standard uncertainty, validity."""
        short, key = self._short(observer.id), f"q:{observer.id}"
        writer = self.writer
        sound = list(self._sound(observer, short))
        flow = writer.named(key, self.names.new(f"Q_{short}"))
        known = [*(self.readings[s].ok for s in observer.signals), *writer.conditions(key)]
        slopes = {}
        for name in self.ruleset.plan.outputs:
            if is_output_of(name, {observer.id}, ("s",)):
                error = name.split(":", 2)[2]
                slopes[error] = writer.named(name, self._slope(observer, short, error))
                sound += writer.conditions(name)
        for name in self.ruleset.undo.outputs:
            if is_output_of(name, {observer.id}, ("dq",)):
                fault = name.split(":", 2)[2]
                what = f"slope of {short} by the degree of {fault} that is undone"
                wanted = f"{short}_undo_{self._short(fault)}"
                writer.named(name, self.outputs.number(wanted, name, what, f"{FLOW} per degree"))
        sound = [*(c for c in sound if c not in known), apply("gt", flow, Number(0.0))]
        self.flow[observer.id], self.slopes[observer.id] = flow, slopes
        statements = [*writer.taken(), *self._checked_flow(observer, short, known, sound)]
        parts = {error: [(1, slope)] for error, slope in slopes.items()}
        statements += self._spread(short, observer.id, parts, self.valid[observer.id])
        return Section(f"{observer.equation}   ({observer.origin})", tuple(statements))

    def _sound(self, observer: ObserverSpec, short: str) -> Iterator[Expression]:
        """Where the equation holds: readings at or above their minimum, and its own conditions."""
        for signal in observer.signals:
            minimum = self.ruleset.signal_by_id[signal].minimum
            if minimum is not None:
                yield apply("ge", self.readings[signal].si, Number(minimum))
        for guard in observer.guards:
            name = self.names.new(_quotient(guard.text) or f"{short}_guard")
            self.writer.named(guard.output, name, f"{guard.text}: must be positive")
            yield apply("gt", Name(name), Number(0.0))

    def _checked_flow(
        self, observer: ObserverSpec, short: str, known: list[Expression], sound: list[Expression]
    ) -> Iterator[Statement]:
        """Flow, whether it can be calculated, and whether it may be used."""
        outputs = self.outputs
        text = f"{short} can be calculated"
        is_known = outputs.flag(f"{short}_known", f"known:{observer.id}", text)
        yield Statement(is_known, every(known), "bool")
        valid = outputs.flag(f"{short}_valid", f"valid:{observer.id}", f"{short} may be used")
        yield Statement(valid, every([Name(is_known), *sound]), "bool")
        self.valid[observer.id] = Name(valid)
        text = f"{observer.equation}; 0 where not known"
        name = outputs.number(short, f"q:{observer.id}", text)
        flow = self.flow[observer.id]
        yield Statement(name, apply("select", Name(is_known), flow, Number(0.0)))

    def _slope(self, observer: ObserverSpec, short: str, error: str) -> str:
        bare, unit = self._short(error), FLOW
        if error in self.readings:
            unit, what = f"{FLOW} per SI", f"slope of {short} by {error}"
        elif error in self.ruleset.misfits:
            bare, what = "misfit", f"standard uncertainty of {short} by its own misfit"
        else:
            what = f"slope of {short} by parameter {error}, per standard uncertainty"
        return self.outputs.number(f"{short}_by_{bare}", f"s:{observer.id}:{error}", what, unit)

    def _spread(
        self, short: str, id_: str, parts: dict[str, Terms], valid: Name
    ) -> Iterator[Statement]:
        """Standard uncertainty of a signed sum of estimates as an output."""
        bare = {error: self._short(error) for error in parts}
        statements, u = spread(parts, self.u, bare, short, self.outputs)
        yield from statements
        name = self.outputs.number(f"u_{short}", f"u:{id_}", f"standard uncertainty of {short}")
        yield Statement(name, apply("select", valid, u, Number(0.0)))

    def _residual(self, residual: ResidualSpec) -> Section:
        """A residual of observers of this module alone, with its threshold."""
        outputs, short, id_ = self.outputs, self._short(residual.id), residual.id
        valid = outputs.flag(f"R_{short}_valid", f"valid:R:{id_}", f"{short} may be used")
        sound = every(self.valid[t.observer] for t in residual.terms)
        value = signed([(t.sign, self.flow[t.observer]) for t in residual.terms])
        name = outputs.number(f"R_{short}", f"R:{id_}", f"{residual.text}; 0 where not valid")
        parts: dict[str, Terms] = {}
        for term in residual.terms:
            for error, slope in self.slopes[term.observer].items():
                parts.setdefault(error, []).append((term.sign, slope))
        statements = [
            Statement(valid, sound, "bool"),
            Statement(name, apply("select", Name(valid), value, Number(0.0))),
            *self._spread(f"R_{short}", id_, parts, Name(valid)),
        ]
        limit = apply("mul", Number(runtime_limits.THRESHOLD), Name(statements[-1].name))
        text = "beyond it the residual has moved"
        threshold = outputs.number(f"threshold_{short}", f"threshold:{id_}", text)
        far = apply("gt", apply("abs", Name(name)), Name(threshold))
        text = f"{short} is beyond its threshold"
        moved = outputs.flag(f"moved_{short}", f"moved:{id_}", text)
        statements += [Statement(threshold, limit), Statement(moved, far, "bool")]
        return Section(f"Residual {residual.text}", tuple(statements))


def _quotient(text: str) -> str:
    """A quotient of two names as a name; empty for anything else."""
    above, _, below = (part.strip() for part in text.partition("/"))
    return f"{above}_per_{below}" if above.isidentifier() and below.isidentifier() else ""


Terms = list[tuple[int, Name]]
"""A signed sum."""


def of_reading(
    reading: Reading, noise: Variable, whole: str, outputs: Outputs
) -> Iterator[Statement]:
    """Whether a reading may be used, its uncertainties, and whether it leaves the calibrated range.

    `whole` is the name of its standard uncertainty, SI.
    """
    signal, short = reading.signal, reading.value.name
    fit = outputs.flag(f"{short}_fit", f"fit:{signal.id}", f"{short} may be used")
    yield Statement(fit, reading.ok, "bool")
    text = f"standard uncertainty of {short} that does not average out"
    systematic = outputs.number(f"{short}_systematic", f"systematic:{signal.id}", text, "SI")
    yield Statement(systematic, _systematic(signal, reading.si))
    noise_si = outputs.names.new(f"{short}_noise_SI")
    yield Statement(noise_si, noise_in_si(signal, Name(noise.name)))
    squares: list[Expression] = [apply("mul", Name(x), Name(x)) for x in (systematic, noise_si)]
    yield Statement(whole, apply("sqrt", total(squares)))
    if signal.valid_from is not None and signal.valid_to is not None:
        slack = runtime_limits.BEYOND_CALIBRATED * (signal.valid_to - signal.valid_from)
        above = apply("ge", reading.si, Number(signal.valid_from - slack))
        below = apply("le", reading.si, Number(signal.valid_to + slack))
        text = f"{short} is out of the range in which the equations were calibrated"
        beyond = outputs.flag(f"{short}_beyond", f"beyond:{signal.id}", text)
        yield Statement(beyond, apply("not", apply("and", above, below)), "bool")


def _systematic(signal: SignalSpec, value: Expression) -> Expression:
    """Systematic standard uncertainty by the sensor's class, SI."""
    if signal.kind == "reading":
        size = apply("sub", value, Number(signal.offset)) if signal.offset else value
        return apply("mul", Number(signal.standard), apply("abs", size))
    scale = (signal.full_scale or 0.0) if signal.kind == "full scale" else 1.0
    return Number(signal.standard * scale)


def spread(
    parts: Mapping[str, Terms],
    u: Mapping[str, Name],
    short: Mapping[str, str],
    into: str,
    outputs: Outputs,
) -> tuple[list[Statement], Expression]:
    """The statements that a standard uncertainty of a signed sum of estimates needs, and itself.

    `parts` are slopes per error, `u` the standard uncertainties of errors that are not whitened,
    `short` the names of errors.
    """
    statements: list[Statement] = []
    squares: list[Expression] = []
    for error, terms in parts.items():
        slope = signed(terms)
        if error in u:
            slope = apply("mul", slope, u[error])
        if isinstance(slope, Apply):
            name = outputs.names.new(f"{into}_due_to_{short[error]}")
            statements.append(Statement(name, slope))
            slope = Name(name)
        squares.append(apply("mul", slope, slope))
    return statements, apply("sqrt", total(squares))


def signed(terms: Terms) -> Expression:
    """A signed sum, positive terms first."""
    (sign, first), *rest = sorted(terms, key=lambda t: -t[0])
    result: Expression = first if sign > 0 else apply("neg", first)
    for sign, name in rest:
        result = apply("add" if sign > 0 else "sub", result, name)
    return result


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
    put_into(graph, part, wanted, {})
    plan = graph.plan()
    parameters = named_constants(ruleset, module, plan.constants, names)
    given: dict[str, Expression] = {n: r.si for n, r in readings.items()}
    given |= {n: Name(d.name) for n, d in degrees.items()}
    writer = Writer(plan, given, {p.value: Name(p.name) for p in parameters}, names)
    sections = [checked(readings.values())]
    for observer in observers:
        own_readings = [readings[s] for s in observer.signals if s in readings]
        sections.append(_section(observer, own_readings, wanted, writer, outputs))
    whole = Routine(
        name="undo",
        text="The same estimates with faults undone, as functions of their degrees: for a central "
        "part that asks. A degree of 0 is no fault.",
        inputs=(*(v for r in readings.values() for v in (r.value, r.good)), *degrees.values()),
        parameters=parameters,
        sections=tuple(sections),
        outputs=tuple(outputs.variables),
    )
    return without_unused(whole)


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
