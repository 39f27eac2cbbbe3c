"""Check a module type: names, signals, parameters, equations, residuals, faults."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from rulec.diagnostics import Diagnostic, Place, did_you_mean
from rulec.document import Document
from rulec.expression import NAME, Expression
from rulec.knowledge import (
    Definition,
    FaultType,
    FaultUse,
    ModuleType,
    Observer,
    Parameter,
    SensorClass,
    Signal,
)
from rulec.part_readers import origin_of, read_expression, read_unit, within
from rulec.units import Unit, UnitTable


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

    def read(self) -> ModuleType:
        data = self.document.data
        signals = {n: self._signal(n, s) for n, s in data["signals"].items()}
        parameters = {n: self._parameter(n, p) for n, p in data.get("parameters", {}).items()}
        self._refuse_double_names()
        provides = self._provides(signals)
        expressions = {
            n: read_expression(self.document, ("definitions", n, "is"), self.found)
            for n in data.get("definitions", {})
        }
        known = {*signals, *parameters, *expressions}
        for name, expression in expressions.items():
            self._check_names(expression, known, ("definitions", name, "is"))
        order = self._order(expressions)
        definitions = {
            n: Definition(n, expressions[n], data["definitions"][n].get("title", n)) for n in order
        }
        observers = {n: self._observer(n, o, known) for n, o in data.get("observers", {}).items()}
        self._check_used(signals, parameters, expressions, observers)
        gathers = {n for e in self._expressions(expressions, observers) for n, _ in e.gathered()}
        return ModuleType(
            data["module"],
            data["version"],
            data["title"],
            signals,
            provides,
            parameters,
            definitions,
            observers,
            self._residuals(observers),
            self._fault_uses(signals, definitions, observers),
            tuple(sorted(gathers)),
            self.document.path,
        )

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
        elif wanted != unit.dimension and unit.text in self.units.units:
            message = f"'{unit.text}' is not a unit of {part['quantity']}"
            self._report(place(*path, "unit"), "KB053", message)
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
        elif sensor.kind == "value" and sensor.unit.dimension != unit.dimension:
            message = f"the class '{sensor.name}' is in {sensor.unit.text}, not in {unit.text}"
            self._report(place(*path, "sensor"), "KB033", message)
        return Signal(
            name,
            part["quantity"],
            unit,
            part["sensor"],
            None if high is None else (high - low) * unit.factor,
            _si(unit, low),
            _si(unit, high),
            _si(unit, part.get("minimum")),
            _si(unit, part.get("reference")),
            part.get("input", False),
        )

    def _parameter(self, name: str, part: Mapping[str, Any]) -> Parameter:
        path = ("parameters", name)
        unit = read_unit(self.document, (*path, "unit"), self.units, self.found)
        return Parameter(
            name,
            unit.to_si(part["value"]),
            part["u"] * unit.factor,
            unit,
            part.get("fit", True),
            part.get("title", name),
            origin_of(self.document, *path, source=part["source"]),
        )

    def _refuse_double_names(self) -> None:
        first: dict[str, Place] = {}
        for group in ("signals", "parameters", "definitions"):
            for name in self.document.data.get(group, {}):
                place = self.document.key(group, name)
                if not NAME.fullmatch(name):
                    self._report(place, "KB024", f"'{name!r}' is not a legal name")
                if name in first:
                    message = f"the name '{name}' means two things"
                    self.found.append(
                        Diagnostic(place, "KB034", message, "rename one", first[name])
                    )
                first.setdefault(name, place)

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

        def visit(name: str) -> None:
            if state.get(name) == 2:
                return
            if state.get(name) == 1:
                place = self.document.key("definitions", name)
                self._report(place, "KB037", f"'{name}' is defined by itself")
                return
            state[name] = 1
            for used, _ in expressions[name].names():
                if used in expressions:
                    visit(used)
            state[name] = 2
            order.append(name)

        for name in expressions:
            visit(name)
        return order

    def _observer(self, name: str, part: Mapping[str, Any], known: set[str]) -> Observer:
        path = ("observers", name)
        expression = read_expression(self.document, (*path, "Q"), self.found)
        self._check_names(expression, known, (*path, "Q"))
        origin = origin_of(self.document, *path, source=part["source"])
        return Observer(name, part["component"], expression, part.get("reference", False), origin)

    @staticmethod
    def _expressions(
        definitions: Mapping[str, Expression], observers: Mapping[str, Observer]
    ) -> Iterable[Expression]:
        yield from definitions.values()
        yield from (o.expression for o in observers.values())

    def _check_used(
        self,
        signals: Mapping[str, Signal],
        parameters: Mapping[str, Parameter],
        definitions: Mapping[str, Expression],
        observers: Mapping[str, Observer],
    ) -> None:
        """Refuse parameters that no equation uses, and observers that use no signal."""
        used = {n for e in self._expressions(definitions, observers) for n, _ in e.names()}
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
            first, second = text.split("-")
            for name in (first, second):
                if name not in observers:
                    place = self.document.place("residuals", i)
                    hint = did_you_mean(name, observers)
                    message = f"there is no observer '{name}' in this module"
                    self._report(place, "KB046", message, hint)
            pairs.append((first, second))
        return tuple(p for p in pairs if p[0] in observers and p[1] in observers)

    def _fault_uses(
        self,
        signals: Mapping[str, Signal],
        definitions: Mapping[str, Definition],
        observers: Mapping[str, Observer],
    ) -> tuple[FaultUse, ...]:
        uses = []
        targets: dict[str, Iterable[str]] = {
            "signal": signals,
            "definition": definitions,
            "flow": {o.component for o in observers.values()},
        }
        for i, text in enumerate(self.document.data.get("faults", ())):
            name, target = text.rstrip(")").split("(")
            place = self.document.place("faults", i)
            fault = self.faults.get(name)
            if fault is None:
                hint = did_you_mean(name, self.faults)
                self._report(place, "KB047", f"there is no fault '{name}'", hint)
                continue
            known = targets[fault.acts_on]
            if target not in known:
                kind = {"flow": "component"}.get(fault.acts_on, fault.acts_on)
                hint = did_you_mean(target, known)
                message = f"'{name}' acts on a {kind}; '{target}' is none of this module"
                self._report(place, "KB048", message, hint)
                continue
            use = FaultUse(name, target, place)
            if use in uses:
                self._report(place, "KB049", f"'{text}' stands twice", "keep one")
                continue
            uses.append(use)
        return tuple(uses)


def _si(unit: Unit, value: float | None) -> float | None:
    return None if value is None else unit.to_si(value)
