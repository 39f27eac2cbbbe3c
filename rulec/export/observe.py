"""The routine that a controller calls at each operating point: estimates with all that the central
part needs of them, and the residuals that the module can judge by itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import rulec_runtime.limits as runtime_limits
from rulec_runtime.contract.ruleset import ObserverSpec, ResidualSpec, Ruleset, SignalSpec

from rulec.export.hints import hints_of
from rulec.export.identifiers import Identifiers
from rulec.export.parameters import named_constants
from rulec.export.program import (
    Apply,
    Expression,
    Kind,
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
from rulec.export.readings import Reading, checked, noise_in_si, reading_of
from rulec.export.specialised import graph_of, put_into
from rulec.export.writer import Writer

FLOW = "m3/s"


def observe_routine(ruleset: Ruleset, module: str) -> Routine:
    """Estimates of a module at given readings."""
    return _Observe(ruleset, module).routine()


@dataclass(frozen=True)
class _Error:
    """An error of estimates: its id, and the name of its standard uncertainty if the slope is not
    in such units already."""

    id: str
    u: Name | None


class _Observe:
    """Builds the routine; `slopes` are, per observer and error, names of outputs."""

    def __init__(self, ruleset: Ruleset, module: str) -> None:
        self.ruleset, self.module = ruleset, module
        self.observers = [o for o in ruleset.observers if o.module == module]
        self.names = Identifiers()
        self.outputs: list[Variable] = []
        ids = {s for o in self.observers for s in o.signals}
        signals = [s for s in ruleset.signals if s.id in ids]
        self.readings = {s.id: reading_of(s, module, self.names) for s in signals}
        self.noise = {s.id: self._noise(s) for s in signals}
        self.u: dict[str, Name] = {}
        self.slopes: dict[str, dict[str, Name]] = {}
        self.valid: dict[str, Name] = {}
        self.flow: dict[str, Name] = {}
        self.writer, self.constants = self._writer()

    def routine(self) -> Routine:
        """All sections in order."""
        readings = list(self.readings.values())
        sections = [checked(readings), self._uncertainties()]
        sections += [self._observer(o) for o in self.observers]
        sections += [self._residual(r) for r in self._own_residuals()]
        used, read = without_unused(sections, self.outputs)
        inputs = [v for r in readings for v in (r.value, r.good)]
        return Routine(
            name="observe",
            text="Estimates of the flow through the module at one operating point: call it with "
            "mean readings while the plant is settled.",
            inputs=(*inputs, *self.noise.values()),
            parameters=tuple(p for p in self.constants if p.name in read),
            sections=used,
            outputs=tuple(self.outputs),
        )

    def _noise(self, signal: SignalSpec) -> Variable:
        name = self.readings[signal.id].value.name
        text = f"standard uncertainty of the mean {name} by its noise"
        return Variable(
            self.names.new(f"{name}_noise"), f"noise:{signal.id}", "real", signal.unit, text
        )

    def _writer(self) -> tuple[Writer, tuple[Parameter, ...]]:
        ruleset, plan = self.ruleset, self.ruleset.plan
        known = {n: 1.0 for n in plan.inputs if n.startswith("u:")}
        degrees = {n: 0.0 for n in ruleset.undo.inputs if n.startswith("x:")}
        graph = graph_of(self.readings)
        own = {o.id for o in self.observers}
        wanted = [n for n in plan.outputs if _of(n, own, ("q", "guard", "s"))]
        graph.outputs.update(put_into(graph, plan, wanted, known))
        wanted = [n for n in ruleset.undo.outputs if _of(n, own, ("dq",))]
        graph.outputs.update(put_into(graph, ruleset.undo, wanted, degrees))
        part = graph.plan()
        constants = named_constants(ruleset, self.module, part.constants, self.names)
        given = {n: self.readings[n].si for n in part.inputs}
        by_value = {p.value: Name(p.name) for p in constants}
        known_to_equations = {i: n.partition(".")[2] for i, n in enumerate(part.inputs)}
        for i, value in enumerate(part.constants, len(part.inputs)):
            if value in by_value:
                known_to_equations[i] = by_value[value].text
        hints: dict[int, str] = {}
        for observer in self.observers:
            hints |= hints_of(part, observer, known_to_equations)
        return Writer(part, given, by_value, self.names, hints), constants

    def _output(
        self, wanted: str, id_: str, text: str, unit: str = FLOW, kind: Kind = "real"
    ) -> str:
        name = self.names.new(wanted)
        self.outputs.append(Variable(name, id_, kind, unit, text))
        return name

    def _uncertainties(self) -> Section:
        """Standard uncertainties of the readings, SI, and whether they are known territory."""
        statements = list(self.writer.taken())
        for reading in self.readings.values():
            statements += self._of_reading(reading)
        return Section("Uncertainties of the readings", tuple(statements))

    def _of_reading(self, reading: Reading) -> Iterator[Statement]:
        signal, short = reading.signal, reading.value.name
        fit = self._output(
            f"{short}_fit", f"fit:{signal.id}", f"{short} may be used", unit="", kind="bool"
        )
        yield Statement(fit, reading.ok, "bool")
        systematic = self._output(
            f"{short}_systematic",
            f"systematic:{signal.id}",
            f"standard uncertainty of {short} that does not average out",
            unit="SI",
        )
        yield Statement(systematic, _systematic(signal, reading.si))
        noise = Name(self.names.new(f"{short}_noise_SI"))
        yield Statement(noise.text, noise_in_si(signal, Name(self.noise[signal.id].name)))
        whole = self.names.new(f"u_{short}")
        squares: list[Expression] = [apply("mul", x, x) for x in (Name(systematic), noise)]
        yield Statement(whole, apply("sqrt", total(squares)))
        self.u[signal.id] = Name(whole)
        if signal.valid_from is not None and signal.valid_to is not None:
            slack = runtime_limits.BEYOND_CALIBRATED * (signal.valid_to - signal.valid_from)
            inside = apply(
                "and",
                apply("ge", reading.si, Number(signal.valid_from - slack)),
                apply("le", reading.si, Number(signal.valid_to + slack)),
            )
            name = self._output(
                f"{short}_beyond",
                f"beyond:{signal.id}",
                f"{short} is out of the range in which the equations were calibrated",
                unit="",
                kind="bool",
            )
            yield Statement(name, apply("not", inside), "bool")

    def _observer(self, observer: ObserverSpec) -> Section:
        """One estimate: flow, slopes, standard uncertainty, validity."""
        short = observer.id.partition(".")[2]
        writer, key = self.writer, f"q:{observer.id}"
        sound = list(self._sound(observer, short))
        flow = writer.named(key, self.names.new(f"Q_{short}"))
        known = [*(self.readings[s].ok for s in observer.signals), *writer.conditions(key)]
        slopes = {}
        for error in self._errors(observer):
            slope = f"s:{observer.id}:{error.id}"
            slopes[error.id] = writer.named(slope, self._slope(observer, error))
            sound += writer.conditions(slope)
        for name in self.ruleset.undo.outputs:
            if name.startswith(f"dq:{observer.id}:"):
                writer.named(name, self._by_fault(observer, name))
        sound = [c for c in sound if c not in known]
        statements = [
            *writer.taken(),
            *self._said(observer, short, flow, known, [*sound, apply("gt", flow, Number(0.0))]),
        ]
        self.flow[observer.id], self.slopes[observer.id] = flow, slopes
        parts = {e: [(1, s)] for e, s in slopes.items()}
        statements += self._spread(short, observer.id, parts, self.valid[observer.id])
        return Section(f"{observer.equation}   ({observer.origin})", tuple(statements))

    def _sound(self, observer: ObserverSpec, short: str) -> Iterator[Expression]:
        """Where the equation holds: readings not below their minimum, and its own conditions."""
        for signal in observer.signals:
            minimum = self.ruleset.signal_by_id[signal].minimum
            if minimum is not None:
                yield apply("ge", self.readings[signal].si, Number(minimum))
        for guard in observer.guards:
            name = self.names.new(_in_words(guard.text) or f"{short}_guard")
            self.writer.named(guard.output, name, f"{guard.text}: must be positive")
            yield apply("gt", Name(name), Number(0.0))

    def _said(
        self,
        observer: ObserverSpec,
        short: str,
        flow: Name,
        known: list[Expression],
        sound: list[Expression],
    ) -> Iterator[Statement]:
        """Flow, whether it can be calculated, and whether it may be used."""
        is_known = self._output(
            f"{short}_known", f"known:{observer.id}", f"{short} can be calculated", "", "bool"
        )
        yield Statement(is_known, every(known), "bool")
        valid = self._output(
            f"{short}_valid", f"valid:{observer.id}", f"{short} may be used", "", "bool"
        )
        yield Statement(valid, every([Name(is_known), *sound]), "bool")
        self.valid[observer.id] = Name(valid)
        name = self._output(short, f"q:{observer.id}", f"{observer.equation}; 0 where not known")
        yield Statement(name, apply("select", Name(is_known), flow, Number(0.0)))

    def _errors(self, observer: ObserverSpec) -> list[_Error]:
        prefix = f"s:{observer.id}:"
        ids = [n.removeprefix(prefix) for n in self.ruleset.plan.outputs if n.startswith(prefix)]
        return [_Error(i, self.u.get(i)) for i in ids]

    def _slope(self, observer: ObserverSpec, error: _Error) -> str:
        short = observer.id.partition(".")[2]
        bare = error.id.removeprefix(f"{self.module}.").removeprefix(self.module)
        if error.id in self.readings:
            unit, what = f"{FLOW} per SI", f"slope of {short} by {error.id}"
        elif error.id in self.ruleset.misfits:
            bare, unit, what = "misfit", FLOW, f"standard uncertainty of {short} by its own misfit"
        else:
            unit, what = FLOW, f"slope of {short} by parameter {error.id}, per standard uncertainty"
        return self._output(f"{short}_by_{bare}", f"s:{observer.id}:{error.id}", what, unit)

    def _by_fault(self, observer: ObserverSpec, output: str) -> str:
        short = observer.id.partition(".")[2]
        fault = output.split(":", 2)[2]
        bare = fault.removeprefix(f"{self.module}.")
        what = f"slope of {short} by the degree of {fault} that is undone"
        return self._output(f"{short}_undo_{bare}", output, what, f"{FLOW} per degree")

    def _spread(
        self, short: str, id_: str, parts: Mapping[str, list[tuple[int, Name]]], valid: Name
    ) -> Iterator[Statement]:
        """Standard uncertainty of a signed sum of estimates from their slopes by each error."""
        squares: list[Expression] = []
        for error, terms in parts.items():
            slope = _signed(terms)
            if (u := self.u.get(error)) is not None:
                slope = apply("mul", slope, u)
            if isinstance(slope, Apply):
                name = self.names.new(f"{short}_due_to_{error.removeprefix(f'{self.module}.')}")
                yield Statement(name, slope)
                slope = Name(name)
            squares.append(apply("mul", slope, slope))
        name = self._output(f"u_{short}", f"u:{id_}", f"standard uncertainty of {short}")
        spread = apply("sqrt", total(squares))
        yield Statement(name, apply("select", valid, spread, Number(0.0)))

    def _own_residuals(self) -> list[ResidualSpec]:
        own = {o.id for o in self.observers}
        return [r for r in self.ruleset.residuals if own.issuperset(t.observer for t in r.terms)]

    def _residual(self, residual: ResidualSpec) -> Section:
        """A residual that stays within the module, beside its threshold."""
        short = residual.id.partition(".")[2]
        sound = every([self.valid[t.observer] for t in residual.terms])
        valid = self._output(
            f"R_{short}_valid", f"valid:R:{residual.id}", f"{short} may be used", "", "bool"
        )
        statements = [Statement(valid, sound, "bool")]
        value = _signed([(t.sign, self.flow[t.observer]) for t in residual.terms])
        text = f"{residual.text}; 0 where not valid"
        name = self._output(f"R_{short}", f"R:{residual.id}", text)
        statements.append(Statement(name, apply("select", Name(valid), value, Number(0.0))))
        parts: dict[str, list[tuple[int, Name]]] = {}
        for term in residual.terms:
            for error, slope in self.slopes[term.observer].items():
                parts.setdefault(error, []).append((term.sign, slope))
        statements += self._spread(f"R_{short}", residual.id, parts, Name(valid))
        spread = statements[-1].name
        text = "beyond it the residual has moved"
        threshold = self._output(f"threshold_{short}", f"threshold:{residual.id}", text)
        limit = apply("mul", Number(runtime_limits.THRESHOLD), Name(spread))
        statements.append(Statement(threshold, limit))
        text = f"{short} is beyond its threshold"
        moved = self._output(f"moved_{short}", f"moved:{residual.id}", text, "", "bool")
        far = apply("gt", apply("abs", Name(name)), Name(threshold))
        statements.append(Statement(moved, far, "bool"))
        return Section(f"Residual {residual.text}", tuple(statements))


def _of(output: str, observers: set[str], kinds: tuple[str, ...]) -> bool:
    """Is an output of one of the kinds, and of one of the observers?"""
    kind, _, rest = output.partition(":")
    return kind in kinds and rest.partition(":")[0] in observers


def _in_words(text: str) -> str:
    """A quotient of two names as a name; empty for anything else."""
    above, _, below = (part.strip() for part in text.partition("/"))
    return f"{above}_per_{below}" if above.isidentifier() and below.isidentifier() else ""


def _systematic(signal: SignalSpec, value: Expression) -> Expression:
    """Standard uncertainty that lasts, as the ruleset's sensor class says."""
    if signal.kind == "reading":
        size = apply("sub", value, Number(signal.offset)) if signal.offset else value
        return apply("mul", Number(signal.standard), apply("abs", size))
    scale = (signal.full_scale or 0.0) if signal.kind == "full scale" else 1.0
    return Number(signal.standard * scale)


def _signed(terms: list[tuple[int, Name]]) -> Expression:
    """A signed sum, positive terms first."""
    ordered = sorted(terms, key=lambda t: -t[0])
    result: Expression = Number(0.0)
    for i, (sign, name) in enumerate(ordered):
        if i == 0:
            result = name if sign > 0 else apply("neg", name)
        else:
            result = apply("add" if sign > 0 else "sub", result, name)
    return result
