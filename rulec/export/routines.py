"""The two routines of a module: `observe` estimates at an operating point, with everything that the
central part needs; `undo` estimates without faults of given degrees."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import rulec_runtime.limits as runtime_limits
from rulec_runtime.contract.ruleset import (
    FORM,
    MISFIT,
    ObserverSpec,
    ResidualSpec,
    Ruleset,
    SignalSpec,
)
from rulec_runtime.recordings.recording_file import largest_reading

from rulec.algebra.graph import Graph
from rulec.export.draft import FLOW, Draft
from rulec.export.program import (
    Apply,
    Expression,
    Name,
    Number,
    Routine,
    Variable,
    apply,
    every,
    select,
    total,
)
from rulec.export.value_names import hints_of, is_output_of, named_constants, put_into
from rulec.export.writer import Writer

Terms = list[tuple[int, Name]]
"""A signed sum."""


@dataclass(frozen=True)
class Reading:
    """A reading as input of a routine, under its `name`. `ok` says that the controller calls it
    good and that it is in range; `si` is its value, or a harmless one if it is not `ok`."""

    signal: SignalSpec
    name: str
    si: Name
    ok: Name


def read(draft: Draft, signals: Iterable[SignalSpec], module: str) -> dict[str, Reading]:
    """Readings by signal: inputs, checks and conversions. Names of readings of other modules
    include their module."""
    found = {}
    for signal in signals:
        owner, _, short = signal.id.partition(".")
        name, good, si, ok = (
            draft.names.new(f"{short if owner == module else signal.id}{end}")
            for end in ("", "_good", "_SI", "_ok")
        )
        text = f"{name} comes from its sensor, and is no substitute"
        draft.inputs += [
            Variable(name, signal.id, "real", signal.unit, signal.title),
            Variable(good, f"good:{signal.id}", "bool", "", text),
        ]
        low, high = usable_range(signal)
        given = Name(name)
        is_ok = draft.state(ok, Name(good) & ((given >= low) & (given <= high)), "bool")
        scaled = given if signal.factor == 1.0 else given * signal.factor
        converted = scaled + signal.offset if signal.offset else scaled
        usable = select(is_ok, converted, signal.reference)
        in_si = draft.state(si, usable, comment=f"from {signal.unit}" if signal.unit else "")
        found[signal.id] = Reading(signal, name, in_si, is_ok)
    draft.section(
        "Readings: may they be used, and their values in SI (a harmless one where they may not)"
    )
    return found


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
        self.ruleset, self.module, self.draft = ruleset, module, Draft()
        self.observers = [o for o in ruleset.observers if o.module == module]
        self.own = {o.id for o in self.observers}
        ids = {s for o in self.observers for s in o.signals}
        signals = [s for s in ruleset.signals if s.id in ids]
        self.readings = read(self.draft, signals, module)
        self.noise = {n: self._noise(reading) for n, reading in self.readings.items()}
        self.u = {n: Name(self.draft.names.new(f"u_{r.name}")) for n, r in self.readings.items()}
        self.flow: dict[str, Name] = {}
        self.slopes: dict[str, dict[str, Name]] = {}
        self.valid: dict[str, Name] = {}

    def routine(self) -> Routine:
        """All sections in order."""
        graph = Graph(dict.fromkeys(self.readings))
        plan, undo = self.ruleset.plan, self.ruleset.undo
        # Flows, guards and slopes in one plan; slopes by degrees are those without faults.
        for part, kinds, fixed in (
            (plan, ("q", "guard", "s"), {n: 1.0 for n in plan.inputs if n.startswith("u:")}),
            (undo, ("dq",), {n: 0.0 for n in undo.inputs if n.startswith("x:")}),
        ):
            wanted = [n for n in part.outputs if is_output_of(n, self.own, kinds)]
            put_into(graph, part, wanted, fixed)
        whole = graph.plan()
        names = self.draft.names
        parameters = named_constants(self.ruleset, self.module, whole.constants, names)
        constants = {p.value: Name(p.name) for p in parameters}
        own = f"{self.module}."
        shown = {i: self._short(n) for i, n in enumerate(whole.inputs) if n.startswith(own)}
        for i, value in enumerate(whole.constants, len(whole.inputs)):
            if value in constants:
                shown[i] = constants[value].text
        hints: dict[int, str] = {}
        for observer in self.observers:
            hints |= hints_of(whole, observer, shown)
        given = {n: self.readings[n].si for n in whole.inputs}
        writer = Writer(whole, given, constants, self.draft, hints)
        for name, reading in self.readings.items():
            self._uncertainty(name, reading)
        self.draft.section("Uncertainties of the readings")
        for observer in self.observers:
            self._observer(observer, writer)
        for residual in self.ruleset.residuals:
            if self.own.issuperset(t.observer for t in residual.terms):
                self._residual(residual)
        text = (
            "Estimates of the flow through the module at one operating point: call it with mean "
            "readings while the plant is settled."
        )
        return self.draft.routine("observe", text, parameters)

    def _noise(self, reading: Reading) -> Name:
        name = self.draft.names.new(f"{reading.name}_noise")
        text = f"standard uncertainty of the mean {reading.name} by its noise"
        id_ = f"noise:{reading.signal.id}"
        self.draft.inputs.append(Variable(name, id_, "real", reading.signal.unit, text))
        return Name(name)

    def _short(self, name: str) -> str:
        """A name without its module."""
        return name.removeprefix(f"{self.module}.").removeprefix(f"{self.module}#")

    def _uncertainty(self, id_: str, reading: Reading) -> None:
        """Whether a reading may be used, its standard uncertainties, SI, and whether it leaves the
        calibrated range. An invalid noise counts as the width of the range."""
        draft, signal, short, noise = self.draft, reading.signal, reading.name, self.noise[id_]
        draft.flag(f"{short}_fit", f"fit:{id_}", f"{short} may be used", reading.ok)
        text = f"standard uncertainty of {short} that does not average out"
        by_class = _systematic(signal, reading.si)
        systematic = draft.number(f"{short}_systematic", f"systematic:{id_}", text, by_class, "SI")
        low, high = usable_range(signal)
        usable = select((noise >= 0.0) & (noise <= high - low), noise, high - low)
        factor = abs(signal.factor)
        name = draft.names.new(f"{short}_noise_SI")
        in_si = draft.state(name, usable if factor == 1.0 else usable * factor)
        both = apply("sqrt", systematic * systematic + in_si * in_si)
        draft.state(self.u[id_].text, both)
        if signal.valid_from is not None and signal.valid_to is not None:
            slack = runtime_limits.BEYOND_CALIBRATED * (signal.valid_to - signal.valid_from)
            above, below = signal.valid_from - slack, signal.valid_to + slack
            inside = (reading.si >= above) & (reading.si <= below)
            text = f"{short} is out of the range in which the equations were calibrated"
            draft.flag(f"{short}_beyond", f"beyond:{id_}", text, apply("not", inside))

    def _observer(self, observer: ObserverSpec, writer: Writer) -> None:
        """One estimate: flow, slopes, standard uncertainty, validity."""
        draft, id_, short = self.draft, observer.id, self._short(observer.id)
        sound = list(self._sound(observer, writer))
        flow = writer.named(f"q:{id_}", draft.names.new(f"Q_{short}"))
        ok = [self.readings[s].ok for s in observer.signals]
        needed = [*ok, *writer.conditions(f"q:{id_}")]
        slopes = self.slopes[id_] = {}
        for name in self.ruleset.plan.outputs:
            if is_output_of(name, {id_}, ("s",)):
                error = name.split(":", 2)[2]
                slopes[error] = writer.named(name, self._slope(short, name, error))
                sound += writer.conditions(name)
        for name in self.ruleset.undo.outputs:
            if is_output_of(name, {id_}, ("dq",)):
                fault = name.split(":", 2)[2]
                what = f"slope of {short} by the degree of {fault} that is undone"
                wanted = f"{short}_undo_{self._short(fault)}"
                writer.named(name, draft.output(wanted, name, what, f"{FLOW} per degree"))
        text = f"{short} can be calculated"
        is_known = draft.flag(f"{short}_known", f"known:{id_}", text, every(needed))
        usable = every([is_known, *(c for c in sound if c not in needed), flow > 0.0])
        valid = draft.flag(f"{short}_valid", f"valid:{id_}", f"{short} may be used", usable)
        text = f"{observer.equation}; 0 where not known"
        draft.number(short, f"q:{id_}", text, select(is_known, flow, 0.0))
        self._spread(short, id_, {error: [(1, s)] for error, s in slopes.items()}, valid)
        self.flow[id_], self.valid[id_] = flow, valid
        draft.section(f"{observer.equation}   ({observer.origin})")

    def _sound(self, observer: ObserverSpec, writer: Writer) -> Iterator[Expression]:
        """Where the equation holds: readings at or above their minimum, and its own conditions."""
        for signal in observer.signals:
            minimum = self.ruleset.signal_by_id[signal].minimum
            if minimum is not None:
                yield self.readings[signal].si >= minimum
        for guard in observer.guards:
            above, _, below = (part.strip() for part in guard.text.partition("/"))
            wanted = f"{self._short(observer.id)}_guard"
            if above.isidentifier() and below.isidentifier():
                wanted = f"{above}_per_{below}"
            name = self.draft.names.new(wanted)
            yield writer.named(guard.output, name, f"{guard.text}: must be positive") > 0.0

    def _slope(self, short: str, id_: str, error: str) -> str:
        bare, unit = self._short(error), FLOW
        if error in self.readings:
            unit, what = f"{FLOW} per SI", f"slope of {short} by {error}"
        elif error == f"{id_}{MISFIT}":
            bare, what = "misfit", f"standard uncertainty of {short} by its own misfit"
        elif error.removesuffix(MISFIT).endswith(FORM):
            bare = f"{'new_' * error.endswith(MISFIT)}{bare.removesuffix(MISFIT).replace('.', '_')}"
            what = f"standard uncertainty of {short} by the form of a law"
        else:
            what = f"slope of {short} by parameter {error}, per standard uncertainty"
        return self.draft.output(f"{short}_by_{bare}", id_, what, unit)

    def _spread(self, short: str, id_: str, parts: Mapping[str, Terms], valid: Name) -> Name:
        """Standard uncertainty of a signed sum of estimates as an output; `parts` are slopes per
        error, by parameters for one standard uncertainty."""
        squares: list[Expression] = []
        for error, terms in parts.items():
            moved = signed(terms) * self.u[error] if error in self.u else signed(terms)
            if isinstance(moved, Apply):
                name = self.draft.names.new(f"{short}_due_to_{self._short(error)}")
                moved = self.draft.state(name, moved)
            squares.append(moved * moved)
        u = select(valid, apply("sqrt", total(squares)), 0.0)
        return self.draft.number(f"u_{short}", f"u:{id_}", f"standard uncertainty of {short}", u)

    def _residual(self, residual: ResidualSpec) -> None:
        """A residual of observers of this module alone, with its threshold."""
        draft, short, id_ = self.draft, self._short(residual.id), residual.id
        sound = every(self.valid[t.observer] for t in residual.terms)
        valid = draft.flag(f"R_{short}_valid", f"valid:R:{id_}", f"{short} may be used", sound)
        value = select(
            valid, signed([(t.sign, self.flow[t.observer]) for t in residual.terms]), 0.0
        )
        text = f"{residual.text}; 0 where not valid"
        found = draft.number(f"R_{short}", f"R:{id_}", text, value)
        parts: dict[str, Terms] = {}
        for term in residual.terms:
            for error, slope in self.slopes[term.observer].items():
                parts.setdefault(error, []).append((term.sign, slope))
        limit = Number(runtime_limits.THRESHOLD) * self._spread(f"R_{short}", id_, parts, valid)
        text = "beyond it the residual has moved"
        threshold = draft.number(f"threshold_{short}", f"threshold:{id_}", text, limit)
        text = f"{short} is beyond its threshold"
        draft.flag(f"moved_{short}", f"moved:{id_}", text, apply("abs", found) > threshold)
        draft.section(f"Residual {residual.text}")


def _systematic(signal: SignalSpec, value: Name) -> Expression:
    """Systematic standard uncertainty by the sensor's class, SI."""
    if signal.kind == "reading":
        size = value - signal.offset if signal.offset else value
        return Number(signal.standard) * apply("abs", size)
    scale = (signal.full_scale or 0.0) if signal.kind == "full scale" else 1.0
    return Number(signal.standard * scale)


def signed(terms: Terms) -> Expression:
    """A signed sum, positive terms first."""
    (sign, first), *rest = sorted(terms, key=lambda t: -t[0])
    result: Expression = first if sign > 0 else -first
    for sign, name in rest:
        result = result + name if sign > 0 else result - name
    return result


def undo_routine(ruleset: Ruleset, module: str) -> Routine:
    """Estimates as functions of the degrees of all faults that affect them."""
    draft = Draft()
    observers = [o for o in ruleset.observers if o.module == module]
    own = {o.id for o in observers}
    wanted = [n for n in ruleset.undo.outputs if is_output_of(n, own, ("q", "dq"))]
    part = ruleset.undo.select(tuple(wanted)).narrowed()
    signals = [ruleset.signal_by_id[n] for n in part.inputs if not n.startswith("x:")]
    readings = read(draft, signals, module)
    given: dict[str, Expression] = {n: r.si for n, r in readings.items()}
    for input_ in (n for n in part.inputs if n.startswith("x:")):
        fault = ruleset.fault_by_id[input_.removeprefix("x:")]
        name = draft.names.new(f"x_{fault.id.removeprefix(f'{module}.')}")
        text = f"degree of {fault.id}"
        draft.inputs.append(Variable(name, input_, "real", fault.unit or "1", text))
        given[input_] = Name(name)
    graph = Graph(dict.fromkeys(part.inputs))
    put_into(graph, part, wanted, {})
    plan = graph.plan()
    parameters = named_constants(ruleset, module, plan.constants, draft.names)
    writer = Writer(plan, given, {p.value: Name(p.name) for p in parameters}, draft)
    for observer in observers:
        short, key = observer.id.partition(".")[2], f"q:{observer.id}"
        flow = writer.named(key, draft.names.new(f"Q_{short}"))
        ok = [readings[s].ok for s in observer.signals if s in readings]
        conditions = [*ok, *writer.conditions(key)]
        for slope in (n for n in wanted if n.startswith(f"dq:{observer.id}:")):
            fault_id = slope.split(":", 2)[2]
            bare = fault_id.removeprefix(f"{module}.")
            what = f"slope of {short} by the degree of {fault_id}"
            writer.named(
                slope, draft.output(f"{short}_by_{bare}", slope, what, f"{FLOW} per degree")
            )
            conditions += writer.conditions(slope)
        text = f"{short} may be used"
        valid = draft.flag(f"{short}_valid", f"valid:{observer.id}", text, every(conditions))
        text = f"{short} with the faults undone; 0 where not valid"
        draft.number(short, key, text, select(valid, flow, 0.0))
        draft.section(f"{observer.id} with faults undone")
    text = (
        "The same estimates with faults undone, as functions of their degrees: for a central part "
        "that asks. A degree of 0 is no fault."
    )
    return draft.routine("undo", text, parameters)
