"""Check a module type: names, signals, parameters, equations, residuals, faults."""

import itertools
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

from rulec.knowledge.check_fault import frequency_at
from rulec.knowledge.check_length import check_lengths
from rulec.knowledge.check_regimes import read_regimes
from rulec.knowledge.knowledge import FaultType, SensorClass, adds, has_no_zero, scales_from_zero
from rulec.knowledge.limits import MAX_DEFINITION_CHAIN
from rulec.knowledge.module_type import (
    ENDS,
    Accuracy,
    Definition,
    FaultUse,
    ModuleType,
    Observer,
    Parameter,
    Reading,
    Signal,
    State,
)
from rulec.language.expression import Expression, Rejected, constant, parse
from rulec.language.read_yaml import Path_
from rulec.language.reader import Reader
from rulec.language.units import SECOND, Unit


@dataclass
class ModuleReader(Reader):
    """Reads one module document."""

    sensors: Mapping[str, SensorClass]
    faults: Mapping[str, FaultType]

    def read(self) -> ModuleType:
        """The module type, in SI."""
        data = self.document.data
        signals = {n: self._signal(n, s) for n, s in data.get("signals", {}).items()}
        parameters = {n: self._parameter(n, p) for n, p in data.get("parameters", {}).items()}
        self._check_tables()
        self.check_own_names(("signals", "states", "parameters", "definitions"))
        provides = self._provides(signals)
        before = len(self.found)
        kind = ModuleType(
            name=data["module"],
            version=data["version"],
            title=data["title"],
            signals=signals,
            provides=provides,
            parameters=parameters,
            definitions={n: self._definition(n, d) for n, d in data.get("definitions", {}).items()},
            observers={n: self._observer(n, o) for n, o in data.get("observers", {}).items()},
            residuals=(),
            faults=(),
            gathers=(),
            file=self.document.path,
            states={n: self._state(n, s) for n, s in data.get("states", {}).items()},
            readings=self._readings(signals),
        )
        flows = kind.flows or "readings" in data
        compared = {*signals, *parameters, *kind.definitions}
        names = compared | kind.states.keys() | ({*ENDS} if flows else set())
        for path, expression in kind.equations_at():
            what = "signal, parameter nor definition of this module"
            self.check_names(path, expression, names, what)
        kind = replace(
            kind,
            definitions=self._ordered(kind.definitions),
            regimes=read_regimes(self, signals, compared),
        )
        if len(self.found) == before:
            every = list(kind.equations_at())  # definitions first
            count = len(kind.definitions)
            check_lengths(self, every[:count], every[count:])
        if len(self.found) == before:
            self._check_constants(kind)
            self._check_used(kind)
        if flows:
            self._check_flows(kind)
        return replace(
            kind,
            residuals=self._residuals(kind.observers),
            faults=self._fault_uses(kind, flows),
            gathers=tuple(sorted({name for e in kind.equations() for name, _ in e.gathered()})),
        )

    def _signal(self, name: str, part: Mapping[str, Any]) -> Signal:
        path = ("signals", name)
        unit = self.measured_unit(path)
        signal = Signal(
            name=name,
            quantity=part["quantity"],
            unit=unit,
            sensor=part["sensor"],
            reference=_si(unit, part.get("reference")),
            is_input=part.get("input", False),
            between=part.get("between", "hold"),
        )
        return with_sensor(self, path, signal, unit, self.sensors)

    def _parameter(self, name: str, part: Mapping[str, Any]) -> Parameter:
        path = ("parameters", name)
        unit = self.unit(*path, "unit")
        low, high = 0.0 if part.get("sign") != "any" else -math.inf, math.inf
        if "range" in part:
            self.check_range(*part["range"], *path, "range")
            low, high = (unit.to_si(end) for end in part["range"])
        parameter = Parameter(
            name=name,
            value=unit.to_si(part["value"]),
            u=part["u"] * unit.factor,
            unit=unit,
            fit=part.get("fit", True),
            title=part.get("title", name),
            origin=self.origin(*path, source=part["source"]),
            lowest=low,
            highest=high,
        )
        check_value(self, path, parameter)
        return parameter

    def _check_tables(self) -> None:
        """Refuse points in a unit with an offset, where a share of a value means nothing."""
        for name, table in self.document.data.get("tables", {}).items():
            for key in ("in", "unit"):
                unit = self.units.units.get(table[key])
                if unit is not None and unit.offset:
                    other = self.units.difference(unit).text
                    message = f"the points of a table cannot be in {unit.text}"
                    hint = f"give them in {other}, counted from absolute zero"
                    self.report(("tables", name, key), "KB123", message, hint)

    def _provides(self, signals: Mapping[str, Signal]) -> dict[str, str]:
        provides: dict[str, str] = self.document.data.get("provides", {})
        message = "'{}' is not a signal of this module"
        return {
            name: signal
            for name, signal in provides.items()
            if self.knows(("provides", name), signals, "KB035", message, signal)
        }

    def _ordered(self, definitions: Mapping[str, Definition]) -> dict[str, Definition]:
        """Definitions sorted so that each follows those it uses; circles are reported."""
        result: dict[str, Definition] = {}

        def visit(name: str, chain: tuple[str, ...]) -> None:
            path = ("definitions", name)
            if name in result:
                return
            if name in chain:
                circle = " -> ".join((*chain[chain.index(name) :], name))
                self.report_key(path, "KB037", f"'{name}' is defined by itself", circle)
                return
            if len(chain) == MAX_DEFINITION_CHAIN:
                message = f"{MAX_DEFINITION_CHAIN} definitions stand on one another before '{name}'"
                self.report_key(path, "KB042", message, "write some of them out")
                return
            for used, _ in definitions[name].expression.names():
                if used in definitions:
                    visit(used, (*chain, name))
            result[name] = definitions[name]

        for name in definitions:
            visit(name, ())
        return result

    def _definition(self, name: str, part: Mapping[str, Any]) -> Definition:
        expression = self.expression("definitions", name, "is")
        return Definition(name, expression, part.get("title", name), _accuracy(part))

    def _observer(self, name: str, part: Mapping[str, Any]) -> Observer:
        path = ("observers", name)
        origin = self.origin(*path, source=part["source"])
        expression = self.expression(*path, "Q")
        is_reference = part.get("reference", False)
        return Observer(name, part["component"], expression, is_reference, origin, _accuracy(part))

    def _state(self, name: str, part: Mapping[str, Any]) -> State:
        path = ("states", name)
        unit = self.measured_unit(path)
        units = {"start": unit, "low": unit, "high": unit, "after": self.units.plain(SECOND)}
        return State(
            name=name,
            quantity=part.get("quantity", ""),
            unit=unit,
            title=part.get("title", name),
            rate=self.expression(*path, "der"),
            origin=self.origin(*path, source=part["source"]),
            **{key: self._value((*path, key), own) for key, own in units.items() if key in part},
        )

    def _value(self, path: Path_, unit: Unit) -> Expression:
        """An equation, or a bare number in a unit."""
        value = self.part(path)
        if isinstance(value, (int, float)):
            return parse(repr(unit.to_si(value)))
        return self.expression(*path)

    def _readings(self, signals: Mapping[str, Signal]) -> dict[str, Reading]:
        """Equations of what sensors show; each must be a signal that is no input."""
        result = {}
        for name, part in self.document.data.get("readings", {}).items():
            path = ("readings", name)
            if not self.knows(path, signals, "KB035", "'{}' is not a signal of this module"):
                continue
            if signals[name].is_input:
                message = f"'{name}' is given ('input: true'), so it has no equation"
                self.report_key(path, "KB111", message, "remove one of the two")
            expression = self.expression(*path, "is")
            result[name] = Reading(name, expression, self.origin(*path, source=part["source"]))
        return result

    def _check_flows(self, kind: ModuleType) -> None:
        """Check that the flows of a module are not declared, and that observers use no states or
        flows: they must hold at each moment alone."""
        for group in ("signals", "states", "parameters"):
            for name in ENDS:
                if name in self.document.data.get(group, {}):
                    message = f"'{name}' is what flows through this module; it cannot be declared"
                    hint = "a definition of that name is a law for it"
                    self.report_key((group, name), "KB110", message, hint)
        for observer in kind.observers.values():
            for name in kind.names_through(observer.expression) & {*kind.states, *ENDS}:
                message = f"an observer knows no past, but '{observer.name}' stands on '{name}'"
                hint = "read signals; a definition 'inflow' or 'outflow' is a law for a flow"
                self.report(("observers", observer.name, "Q"), "KB116", message, hint)

    def _check_constants(self, kind: ModuleType) -> None:
        """Refuse invalid numbers that appear only once definitions are combined, such as 1/zero."""
        values: dict[str, float] = {}
        for path, expression in kind.equations_at():
            if path[0] not in ("definitions", "observers"):
                continue
            try:
                value = constant(expression, values)
            except Rejected as error:
                self.report_error(path, error)
                return
            if value is not None:
                values[str(path[1])] = value

    def _check_used(self, kind: ModuleType) -> None:
        """Refuse parameters that no equation uses, and observers that use no signal."""
        used = kind.read
        for name in kind.parameters:
            if name not in used:
                message = f"no equation uses the parameter '{name}'"
                self.report_key(("parameters", name), "KB038", message, "remove it or use it")
        for observer in kind.observers.values():
            parts = kind.with_definitions(observer.expression)
            gathers = any(any(part.gathered()) for part in parts)
            if not (gathers or kind.names_through(observer.expression) & kind.signals.keys()):
                message = f"the observer '{observer.name}' reads no signal"
                hint = "an estimate needs a measurement"
                self.report_key(("observers", observer.name), "KB039", message, hint)

    def _residuals(self, observers: Mapping[str, Observer]) -> tuple[tuple[str, str], ...]:
        """Declared pairs of observers, by default all; sums of the network are added later."""
        listed = self.document.data.get("residuals")
        if listed is None:
            return tuple(itertools.combinations(observers, 2))
        pairs = []
        for i, text in enumerate(listed):
            path = ("residuals", i)
            first, second = text.split("-")
            for name, column in ((first, 0), (second, len(first) + 1)):
                message = "there is no observer '{}' in this module"
                self.knows(path, observers, "KB046", message, name, column)
            if first == second:
                message = f"'{text}' compares an observer with itself"
                self.report(path, "KB059", message, "that is always zero; name two observers")
            elif (first, second) in pairs or (second, first) in pairs:
                hint = "keep one; the other way round it is the same"
                self.report(path, "KB049", f"the pair '{text}' stands twice", hint)
            pairs.append((first, second))
        return tuple(p for p in pairs if p[0] in observers and p[1] in observers)

    def _fault_uses(self, kind: ModuleType, flows: bool) -> tuple[FaultUse, ...]:
        uses: list[FaultUse] = []
        # A flow with a law of the module is a definition like any other; one without a law can
        # leak on the way.
        ends = [end for end in ENDS if flows and end not in kind.definitions]
        targets: dict[str, Collection[str]] = {
            "signal": kind.signals,
            "definition": kind.definitions,
            "flow": [*kind.components(), *ends],
            "liquid": (),
        }
        for i, entry in enumerate(self.document.data.get("faults", ())):
            path: Path_ = ("faults", i)
            text, frequency = entry, None
            if isinstance(entry, dict):
                frequency = frequency_at(self, path, entry, "source")
                path, text = (*path, "fault"), entry["fault"]
            name, target = text.rstrip(")").split("(")
            if not self.knows(path, self.faults, "KB047", "there is no fault '{}'", name):
                continue
            fault = self.faults[name]
            what = {"flow": "component or flow without a law" if flows else "component"}
            where = what.get(fault.acts_on, fault.acts_on)
            known = targets[fault.acts_on]
            if fault.acts_on == "flow" and fault.variants[0].unit:
                # Estimates of a settled flow know shares of it only.
                where, known = "flow without a law, of a module that stores", ends
            message = f"'{name}' acts on a {where}; '{{}}' is none of this module"
            if not self.knows(path, known, "KB048", message, target, len(name) + 1):
                continue
            if fault.acts_on == "signal" and self._has_no_sense(fault, kind.signals[target], path):
                continue
            use = FaultUse(name, target, self.document.place(*path), frequency)
            if use in uses:
                self.report(path, "KB049", f"'{text}' stands twice", "keep one")
            else:
                uses.append(use)
        return tuple(uses)

    def _has_no_sense(self, fault: FaultType, signal: Signal, path: Path_) -> bool:
        """Report a share of a reading with an arbitrary zero, or a size without a stated range."""
        if signal.quantity not in self.units.quantities:
            return False
        text, column = self.part(path), len(fault.name) + 1
        if scales_from_zero(fault) and has_no_zero(signal, self.units):
            others = [f"{f.name}({signal.name})" for f in self.faults.values() if adds(f)]
            quantity = signal.quantity
            message = f"{text}: a share of a {quantity} means nothing, as its zero is arbitrary"
            hint = f"write {' or '.join(others)}" if others else ""
            self.report_word(path, column, signal.name, "KB120", message, hint)
            return True
        if adds(fault) and not signal.full_scale:
            message = f"{text}: how far off '{signal.name}' can be is not known without its range"
            hint = f"add 'range: [..., ...]' to the signal, in {signal.unit.text}"
            self.report_word(path, column, signal.name, "KB122", message, hint)
            return True
        return False


def _accuracy(part: Mapping[str, Any]) -> Accuracy | None:
    """The stated accuracy of a part; one without a source counts as assumed."""
    if "accuracy" not in part:
        return None
    share, _, source = part["accuracy"].partition("%")
    return Accuracy(float(share) / 100, source.lstrip(", ") or "[assumed]")


def _si(unit: Unit, value: float | None) -> float | None:
    return None if value is None else unit.to_si(value)


def with_sensor(
    reader: Reader, path: Path_, signal: Signal, unit: Unit, sensors: Mapping[str, SensorClass]
) -> Signal:
    """A signal with the sensor class, range and minimum, in a unit, that the part at a path states.

    What it does not state remains.
    """
    part = reader.part(path)
    if "range" in part:
        low, high = part["range"]
        reader.check_range(low, high, *path, "range")
        lowest, highest, full_scale = unit.to_si(low), unit.to_si(high), (high - low) * unit.factor
        signal = replace(signal, lowest=lowest, highest=highest, full_scale=full_scale)
    if "minimum" in part:
        signal = replace(signal, minimum=unit.to_si(part["minimum"]))
    signal = replace(signal, sensor=part.get("sensor", signal.sensor))
    sensor = sensors.get(signal.sensor)
    if sensor is None:
        message = "there is no sensor class '{}'"
        reader.knows((*path, "sensor"), sensors, "KB031", message, signal.sensor)
    elif sensor.kind == "full scale" and signal.full_scale is None:
        message = f"the class '{sensor.name}' needs the full scale of this sensor"
        reader.report_key(path, "KB032", message, "add 'range: [0, ...]'")
    elif sensor.kind == "value" and not sensor.unit.dimension.fits(signal.unit.dimension):
        message = f"the class '{sensor.name}' is in {sensor.unit.text}, not in {signal.unit.text}"
        reader.report((*path, "sensor"), "KB033", message, "take a class for this quantity")
    return signal


def check_value(reader: Reader, path: Path_, parameter: Parameter) -> None:
    """Report a value at a path that its parameter cannot have; 0 with u = 0 is a plain number."""
    name, value, unit = parameter.name, parameter.value, parameter.unit
    shown = "" if unit.text == "1" else f" {unit.text}"
    if parameter.highest < float("inf"):
        if not parameter.lowest <= value <= parameter.highest:
            ends = [f"{unit.from_si(e):g}" for e in (parameter.lowest, parameter.highest)]
            message = f"'{name}' lies between {' and '.join(ends)}{shown}"
            reader.report((*path, "value"), "KB125", message, "correct it, or the range")
    elif parameter.lowest >= 0.0 and (value < 0.0 or (value == 0.0 and parameter.u > 0.0)):
        message = f"'{name}' is positive, but its value is {unit.from_si(value):g}{shown}"
        hint = "if it may be zero or negative, say 'sign: any' in the module type"
        reader.report((*path, "value"), "KB125", message, hint)
