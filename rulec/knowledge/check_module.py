"""Check a module type: names, signals, parameters, equations, residuals, faults."""

from __future__ import annotations

import itertools
import keyword
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from rulec.knowledge.check_length import check_lengths
from rulec.knowledge.check_states import StateReader
from rulec.knowledge.degree_unit import adds, has_no_zero, scales_from_zero
from rulec.knowledge.knowledge import FaultType, SensorClass
from rulec.knowledge.module_type import (
    ENDS,
    Definition,
    FaultUse,
    ModuleType,
    Observer,
    Parameter,
    Signal,
)
from rulec.language.diagnostics import Diagnostic, Place, did_you_mean
from rulec.language.document import Document
from rulec.language.expression import Expression, Rejected, constant
from rulec.language.part_readers import origin_of, read_expression, read_unit, within
from rulec.language.units import UNKNOWN, Unit, UnitTable

MAX_CHAIN = 50
"""Definitions that stand on one another; a longer chain is a mistake or an attack."""


def check_module(
    document: Document,
    units: UnitTable,
    sensors: Mapping[str, SensorClass],
    faults: Mapping[str, FaultType],
    found: list[Diagnostic],
) -> ModuleType:
    """Read a module type; mistakes are added to `found`."""
    return _ModuleReader(document, units, sensors, faults, found).read()


@dataclass
class _ModuleReader:
    """Reads one module document; mistakes go to `found`."""

    document: Document
    units: UnitTable
    sensors: Mapping[str, SensorClass]
    faults: Mapping[str, FaultType]
    found: list[Diagnostic] = field(repr=False)
    reserved: set[str] = field(default_factory=set)

    def read(self) -> ModuleType:
        data = self.document.data
        signals = {n: self._signal(n, s) for n, s in data.get("signals", {}).items()}
        parameters = {n: self._parameter(n, p) for n, p in data.get("parameters", {}).items()}
        self._check_own_names()
        provides = self._provides(signals)
        before = len(self.found)
        expressions = {
            n: self._expression("definitions", n, "is") for n in data.get("definitions", {})
        }
        of_states = StateReader(self.document, self.units, self.found)
        names = {*data.get("states", {}), *(ENDS if of_states.flows else ())}
        known = {*signals, *parameters, *expressions, *names}
        for name, expression in expressions.items():
            self._check_names(expression, known, ("definitions", name, "is"))
        order = self._order(expressions)
        definitions = {
            n: Definition(n, expressions[n], data["definitions"][n].get("title", n)) for n in order
        }
        observers = {n: self._observer(n, o, known) for n, o in data.get("observers", {}).items()}
        states, readings = of_states.states(), of_states.readings(signals)
        stated = dict(of_states.equations(states, readings))
        for path, expression in stated.items():
            self._check_names(expression, known, path)
        if len(self.found) == before and not self.reserved:
            self._check_lengths(definitions, observers, stated)
        if len(self.found) == before and not self.reserved:
            self._check_constants(definitions, observers)
            self._check_used(signals, parameters, expressions, observers, stated.values())
        every = (*self._expressions(expressions, observers), *stated.values())
        gathers = {name for e in every for name, _ in e.gathered()}
        kind = ModuleType(
            name=data["module"],
            version=data["version"],
            title=data["title"],
            signals=signals,
            provides=provides,
            parameters=parameters,
            definitions=definitions,
            observers=observers,
            residuals=self._residuals(observers),
            faults=self._fault_uses(signals, definitions, observers, of_states.flows),
            gathers=tuple(sorted(gathers)),
            file=self.document.path,
            states=states,
            readings=readings,
        )
        of_states.check_still(kind)
        return kind

    def _report(self, place: Place, code: str, message: str, hint: str = "") -> None:
        self.found.append(Diagnostic(place, code, message, hint))

    def _signal(self, name: str, part: Mapping[str, Any]) -> Signal:
        path = ("signals", name)
        unit = read_unit(self.document, (*path, "unit"), self.units, self.found)
        place = self.document.place
        wanted = self.units.quantities.get(part["quantity"])
        if wanted is None:
            hint = did_you_mean(part["quantity"], self.units.quantities)
            message = f"there is no quantity '{part['quantity']}'"
            self._report(place(*path, "quantity"), "KB054", message, hint)
        elif not wanted.fits(unit.dimension):
            message = f"'{unit.text}' is not a unit of {part['quantity']}"
            self._report(place(*path, "unit"), "KB053", message, self.units.like(wanted))
            unit = replace(unit, dimension=UNKNOWN)
        low, high = part.get("range", (None, None))
        if low is not None and not low < high:
            self._report(place(*path, "range"), "KB055", "the range is empty", "lower end first")
        sensor = self.sensors.get(part["sensor"])
        if sensor is None:
            hint = did_you_mean(part["sensor"], self.sensors)
            message = f"there is no sensor class '{part['sensor']}'"
            self._report(place(*path, "sensor"), "KB031", message, hint)
        elif sensor.kind == "full scale" and high is None:
            message = f"the class '{sensor.name}' needs the full scale of this sensor"
            self._report(self.document.key(*path), "KB032", message, "add 'range: [0, ...]'")
        elif sensor.kind == "value" and not sensor.unit.dimension.fits(unit.dimension):
            message = f"the class '{sensor.name}' is in {sensor.unit.text}, not in {unit.text}"
            hint = "take a class for this quantity"
            self._report(place(*path, "sensor"), "KB033", message, hint)
        return Signal(
            name=name,
            quantity=part["quantity"],
            unit=unit,
            sensor=part["sensor"],
            full_scale=None if high is None else (high - low) * unit.factor,
            lowest=_si(unit, low),
            highest=_si(unit, high),
            minimum=_si(unit, part.get("minimum")),
            reference=_si(unit, part.get("reference")),
            is_input=part.get("input", False),
            between=part.get("between", "hold"),
        )

    def _parameter(self, name: str, part: Mapping[str, Any]) -> Parameter:
        path = ("parameters", name)
        unit = read_unit(self.document, (*path, "unit"), self.units, self.found)
        return Parameter(
            name=name,
            value=unit.to_si(part["value"]),
            u=part["u"] * unit.factor,
            unit=unit,
            fit=part.get("fit", True),
            title=part.get("title", name),
            origin=origin_of(self.document, *path, source=part["source"]),
        )

    def _check_own_names(self) -> None:
        """Names that equations use: each means one thing, and the equation reader can read it."""
        first: dict[str, Place] = {}
        for group in ("signals", "states", "parameters", "definitions", "provides"):
            for name in self.document.data.get(group, {}):
                place = self.document.key(group, name)
                if keyword.iskeyword(name):
                    message = f"'{name}' is a reserved word and cannot be a name"
                    hint = "it could not stand in an equation; use another name"
                    self._report(place, "KB024", message, hint)
                    self.reserved.add(name)
                if name in first and group != "provides":
                    message = f"the name '{name}' means two things"
                    self.found.append(
                        Diagnostic(place, "KB034", message, "rename one", first[name])
                    )
                first.setdefault(name, place)

    def _expression(self, *path: str) -> Expression:
        """Read an equation; a reserved word in it is told once, where it is declared."""
        mistakes: list[Diagnostic] = []
        expression = read_expression(self.document, path, mistakes)
        self.found += [m for m in mistakes if m.code != "KB024" or not self.reserved]
        return expression

    def _provides(self, signals: Mapping[str, Signal]) -> dict[str, str]:
        provides: dict[str, str] = self.document.data.get("provides", {})
        for name, signal in provides.items():
            if signal not in signals:
                hint = did_you_mean(signal, signals)
                message = f"'{signal}' is not a signal of this module"
                self._report(self.document.place("provides", name), "KB035", message, hint)
        return {n: s for n, s in provides.items() if s in signals}

    def _check_names(
        self, expression: Expression, known: set[str], path: tuple[str | int, ...]
    ) -> None:
        place = self.document.place(*path)
        for name, column in expression.names():
            if name not in known:
                spot = within(place, column, len(name), expression.text)
                hint = did_you_mean(name, known)
                message = f"'{name}' is neither signal, parameter nor definition of this module"
                self._report(spot, "KB036", message, hint)

    def _order(self, expressions: Mapping[str, Expression]) -> list[str]:
        """Definitions so that each stands after those it uses; circles are reported."""
        order: list[str] = []
        state: dict[str, int] = {}

        def visit(name: str, chain: tuple[str, ...]) -> None:
            if state.get(name) == 2:
                return
            place = self.document.key("definitions", name)
            if state.get(name) == 1:
                circle = " -> ".join((*chain[chain.index(name) :], name))
                self._report(place, "KB037", f"'{name}' is defined by itself", circle)
                return
            if len(chain) == MAX_CHAIN:
                message = f"{MAX_CHAIN} definitions stand on one another before '{name}'"
                self._report(place, "KB042", message, "write some of them out")
                return
            state[name] = 1
            for used, _ in expressions[name].names():
                if used in expressions:
                    visit(used, (*chain, name))
            state[name] = 2
            order.append(name)

        for name in expressions:
            visit(name, ())
        return order

    def _observer(self, name: str, part: Mapping[str, Any], known: set[str]) -> Observer:
        path = ("observers", name)
        expression = self._expression(*path, "Q")
        self._check_names(expression, known, (*path, "Q"))
        origin = origin_of(self.document, *path, source=part["source"])
        return Observer(name, part["component"], expression, part.get("reference", False), origin)

    @staticmethod
    def _expressions(
        definitions: Mapping[str, Expression], observers: Mapping[str, Observer]
    ) -> Iterable[Expression]:
        yield from definitions.values()
        yield from (o.expression for o in observers.values())

    def _check_lengths(
        self,
        definitions: Mapping[str, Definition],
        observers: Mapping[str, Observer],
        stated: Mapping[tuple[str | int, ...], Expression],
    ) -> None:
        """Refuse definitions that multiply, before anything is built of them."""
        check_lengths(
            self.document,
            ((d.name, ("definitions", d.name, "is"), d.expression) for d in definitions.values()),
            [
                *((("observers", o.name, "Q"), o.expression) for o in observers.values()),
                *stated.items(),
            ],
            self.found,
        )

    def _check_constants(
        self, definitions: Mapping[str, Definition], observers: Mapping[str, Observer]
    ) -> None:
        """Refuse numbers that only appear when definitions are put together, as 1/zero."""
        known: dict[str, float] = {}
        parts = [(("definitions", d.name, "is"), d.expression) for d in definitions.values()]
        parts += [(("observers", o.name, "Q"), o.expression) for o in observers.values()]
        for path, expression in parts:
            try:
                value = constant(expression, known)
            except Rejected as error:
                place = self.document.place(*path)
                spot = within(place, error.column, error.length, expression.text)
                self._report(spot, error.code, error.message, error.hint)
                return
            if value is not None:
                known[path[1]] = value

    def _check_used(
        self,
        signals: Mapping[str, Signal],
        parameters: Mapping[str, Parameter],
        definitions: Mapping[str, Expression],
        observers: Mapping[str, Observer],
        of_states: Iterable[Expression],
    ) -> None:
        """Refuse parameters that no equation uses, and observers that use no signal."""
        equations = (*self._expressions(definitions, observers), *of_states)
        used = {n for e in equations for n, _ in e.names()}
        for name in parameters:
            if name not in used:
                place = self.document.key("parameters", name)
                message = f"no equation uses the parameter '{name}'"
                self._report(place, "KB038", message, "remove it or use it")
        for observer in observers.values():
            if not self._reads_signal(observer.expression, signals, definitions, set()):
                place = self.document.key("observers", observer.name)
                message = f"the observer '{observer.name}' reads no signal"
                self._report(place, "KB039", message, "an estimate needs a measurement")

    def _reads_signal(
        self,
        expression: Expression,
        signals: Mapping[str, Signal],
        definitions: Mapping[str, Expression],
        seen: set[str],
    ) -> bool:
        for name, _ in itertools.chain(expression.names(), expression.gathered()):
            if name in signals or name not in definitions:
                if name in signals:
                    return True
            elif name not in seen:
                seen.add(name)
                if self._reads_signal(definitions[name], signals, definitions, seen):
                    return True
        return any(True for _ in expression.gathered())

    def _residuals(self, observers: Mapping[str, Observer]) -> tuple[tuple[str, str], ...]:
        """Declared pairs. Partners that only the network knows (sums) are not checked here."""
        listed = self.document.data.get("residuals")
        if listed is None:
            return tuple(itertools.combinations(observers, 2))
        pairs = []
        for i, text in enumerate(listed):
            place = self.document.place("residuals", i)
            first, second = text.split("-")
            for name, column in ((first, 0), (second, len(first) + 1)):
                if name not in observers:
                    spot = within(place, column, len(name), text)
                    hint = did_you_mean(name, observers)
                    message = f"there is no observer '{name}' in this module"
                    self._report(spot, "KB046", message, hint)
            if first == second:
                message = f"'{text}' compares an observer with itself"
                self._report(place, "KB059", message, "that is always zero; name two observers")
            elif (first, second) in pairs or (second, first) in pairs:
                hint = "keep one; the other way round it is the same"
                self._report(place, "KB049", f"the pair '{text}' stands twice", hint)
            pairs.append((first, second))
        return tuple(p for p in pairs if p[0] in observers and p[1] in observers)

    def _fault_uses(
        self,
        signals: Mapping[str, Signal],
        definitions: Mapping[str, Definition],
        observers: Mapping[str, Observer],
        flows: bool,
    ) -> tuple[FaultUse, ...]:
        uses = []
        # A law of the module for a flow is a definition like any other; what flows without one
        # can be lost on the way.
        ends = [end for end in ENDS if flows and end not in definitions]
        targets: dict[str, Iterable[str]] = {
            "signal": signals,
            "definition": definitions,
            "flow": dict.fromkeys([*(o.component for o in observers.values()), *ends]),
        }
        for i, text in enumerate(self.document.data.get("faults", ())):
            name, target = text.rstrip(")").split("(")
            place = self.document.place("faults", i)
            spot = within(place, len(name) + 1, len(target), text)
            fault = self.faults.get(name)
            if fault is None:
                hint = did_you_mean(name, self.faults)
                where = within(place, 0, len(name), text)
                self._report(where, "KB047", f"there is no fault '{name}'", hint)
                continue
            known = targets[fault.acts_on]
            if target not in known:
                kind = {"flow": "component or flow without a law" if flows else "component"}.get(
                    fault.acts_on, fault.acts_on
                )
                hint = did_you_mean(target, known)
                message = f"'{name}' acts on a {kind}; '{target}' is none of this module"
                self._report(spot, "KB048", message, hint)
                continue
            signal = signals.get(target) if fault.acts_on == "signal" else None
            if signal is not None and self._has_no_sense(fault, signal, text, spot):
                continue
            use = FaultUse(name, target, place)
            if use in uses:
                self._report(place, "KB049", f"'{text}' stands twice", "keep one")
                continue
            uses.append(use)
        return tuple(uses)

    def _has_no_sense(self, fault: FaultType, signal: Signal, text: str, spot: Place) -> bool:
        """Report a share of a reading without a zero, or a size within a range nobody stated."""
        if signal.quantity not in self.units.quantities:
            return False
        if scales_from_zero(fault) and has_no_zero(signal, self.units):
            others = [f"{f.name}({signal.name})" for f in self.faults.values() if adds(f)]
            message = (
                f"{text}: a share of a {signal.quantity} means nothing, as its zero is arbitrary"
            )
            self._report(spot, "KB120", message, f"write {' or '.join(others)}" if others else "")
            return True
        if adds(fault) and not signal.full_scale:
            message = f"{text}: how far off '{signal.name}' can be is not known without its range"
            hint = f"add 'range: [..., ...]' to the signal, in {signal.unit.text}"
            self._report(spot, "KB122", message, hint)
            return True
        return False


def _si(unit: Unit, value: float | None) -> float | None:
    return None if value is None else unit.to_si(value)
