"""Pass 2a, check knowledge: documents to checked module types, faults and sensors, in SI."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import sympy

from rulec.diagnostics import Diagnostic, Place, Refused, did_you_mean
from rulec.document import Document
from rulec.expression import NAME, Expression, Rejected, dimension, parse, to_sympy
from rulec.invert import invert
from rulec.knowledge import (
    Definition,
    FaultType,
    FaultUse,
    Knowledge,
    ModuleType,
    Observer,
    Origin,
    Parameter,
    SensorClass,
    Signal,
    Variant,
)
from rulec.read import Sources
from rulec.units import NONE, VOLUME_FLOW, Dimension, Unit, UnitTable, unit_table


def check_knowledge(sources: Sources) -> Knowledge:
    """Check the meaning of all knowledge documents; raises `Refused` with every mistake."""
    found: list[Diagnostic] = []
    units = unit_table(sources.units.data)
    table = sources.by_kind
    for kind in ("module", "fault", "sensor", "fluid"):
        _refuse_twins(table.get(kind, ()), kind, found)
    sensors = {d.data["sensor"]: _sensor(d, units, found) for d in table.get("sensor", ())}
    faults = {d.data["fault"]: _fault(d, found) for d in table.get("fault", ())}
    for document in table.get("fluid", ()):
        _fluid(document, units, found)
    modules: dict[str, ModuleType] = {}
    for document in table.get("module", ()):
        reader = _ModuleReader(document, units, sensors, faults, found)
        modules[document.data["module"]] = reader.read()
    provided = _provided(modules, units)
    for document in table.get("module", ()):
        module = modules[document.data["module"]]
        _check_dimensions(document, module, units, provided, found)
    if found:
        raise Refused(found)
    return Knowledge(units, sensors, faults, modules)


def _refuse_twins(documents: Iterable[Document], kind: str, found: list[Diagnostic]) -> None:
    first: dict[str, Document] = {}
    for document in documents:
        name = document.data[kind]
        if name in first:
            message = f"the {kind} '{name}' is described in two files"
            second = first[name].place(kind)
            found.append(Diagnostic(document.place(kind), "KB030", message, "rename one", second))
        first.setdefault(name, document)


def origin_of(document: Document, *path: str | int, source: str = "") -> Origin:
    """Origin of a part of a document."""
    place = document.key(*path) if path else document.place()
    return Origin(place.file, place.line, source)


def read_unit(
    document: Document, path: tuple[str | int, ...], units: UnitTable, found: list[Diagnostic]
) -> Unit:
    """Read the unit at a path; an unknown one is reported and counts as a plain number."""
    part = document.data
    for step in path:
        part = part[step]
    try:
        return units.parse(part)
    except ValueError as error:
        name = str(error)
        hint = did_you_mean(name, units.units)
        message = f"there is no unit '{name[:40]}'"
        found.append(Diagnostic(document.place(*path), "KB050", message, hint))
        return Unit(part, 1.0, NONE)


def _sensor(document: Document, units: UnitTable, found: list[Diagnostic]) -> SensorClass:
    data, part = document.data, document.data["systematic"]
    unit = read_unit(document, ("systematic", "unit"), units, found)
    relative = part["of"] != "value"
    if relative and unit.dimension != NONE:
        message = f"a bound of the {part['of']} is a share, but '{unit.text}' is {unit.dimension}"
        found.append(Diagnostic(document.place("systematic", "unit"), "KB053", message, "use %"))
    return SensorClass(
        data["sensor"],
        data["title"],
        part["of"],
        part["bound"] * unit.factor / data["coverage"],
        unit,
        origin_of(document, "systematic", source=data["source"]),
    )


def _fluid(document: Document, units: UnitTable, found: list[Diagnostic]) -> None:
    expected = {"density": {"kg": 1, "m": -3}, "viscosity": {"kg": 1, "m": -1, "s": -1}}
    for key, exponents in expected.items():
        unit = read_unit(document, (key, "unit"), units, found)
        if unit.dimension != Dimension.of(exponents):
            message = f"'{unit.text}' is not a unit of {key}"
            found.append(Diagnostic(document.place(key, "unit"), "KB053", message))


def _fault(document: Document, found: list[Diagnostic]) -> FaultType:
    data = document.data
    parts = data.get("variants") or {"": data}
    variants = []
    for name, part in parts.items():
        path: tuple[str | int, ...] = ("variants", name) if name else ()
        law = _law(document, (*path, "law"), found)
        lowest, highest = part["degree"]["range"]
        title = part["title"]
        variants.append(Variant(name, title, law, lowest, highest, part["degree"]["meaning"]))
    return FaultType(
        data["fault"],
        data["title"],
        data["acts_on"],
        tuple(variants),
        data["tolerance"],
        data["status"],
        data["text"],
        data["action"],
        origin_of(document, "fault", source=data["source"]),
    )


def _law(document: Document, path: tuple[str | int, ...], found: list[Diagnostic]) -> Expression:
    """Read the law of a fault: only g and x, g when x is 0, solvable for both."""
    expression = read_expression(document, path, found)
    names = {name for name, _ in expression.names()}
    place = document.place(*path)
    for name, column in expression.names():
        if name not in ("g", "x"):
            spot = within(place, column, len(name), expression.text)
            message = f"the law of a fault speaks of g and x only, not of '{name}'"
            found.append(Diagnostic(spot, "KB061", message))
    if names - {"g", "x"}:
        return expression
    if names != {"g", "x"}:
        missing = sorted({"g", "x"} - names)[0]
        message = f"'{missing}' does not occur in the law"
        found.append(Diagnostic(place, "KB062", message, "as in (1 + x)*g"))
        return expression
    g, x, value = sympy.symbols("g x value", real=True)
    law = to_sympy(expression, {"g": g, "x": x})
    if sympy.expand(law.subs(x, 0) - g) != 0:
        message = "at degree 0 this law does not give g back"
        found.append(Diagnostic(place, "KB063", message, "a fault of degree 0 must change nothing"))
    elif invert(law, g, value) is None or invert(law, x, value) is None:
        message = "this law cannot be solved for g and x"
        found.append(Diagnostic(place, "KB064", message, "let g and x occur once each"))
    return expression


def read_expression(
    document: Document, path: tuple[str | int, ...], found: list[Diagnostic]
) -> Expression:
    """Read the equation at a path; a refused one is reported and counts as 0."""
    part = document.data
    for step in path:
        part = part[step]
    try:
        return parse(str(part))
    except Rejected as error:
        place = within(document.place(*path), error.column, error.length, str(part))
        found.append(Diagnostic(place, error.code, error.message, error.hint))
        return parse("0")


def within(place: Place, column: int, length: int, text: str) -> Place:
    """Place of a part of a one-line scalar, which may be quoted."""
    quote = 1 if place.length == len(text) + 2 else 0
    if place.length < len(text):
        return place
    return Place(place.file, place.line, place.column + quote + column, length)


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
        gathers = {
            n for e in self._expressions(expressions, observers) for n, _ in e.gathered()
        }
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
                    self.found.append(Diagnostic(place, "KB034", message, "rename one", first[name]))
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


def _provided(
    modules: Mapping[str, ModuleType], units: UnitTable
) -> dict[str, Dimension]:
    """Dimension of each name that some module type provides."""
    return {
        name: module.signals[signal].unit.dimension
        for module in modules.values()
        for name, signal in module.provides.items()
    }


def _check_dimensions(
    document: Document,
    module: ModuleType,
    units: UnitTable,
    provided: Mapping[str, Dimension],
    found: list[Diagnostic],
) -> None:
    """Check the dimensions of every equation as written."""
    if any(d.place.file == document.path for d in found):
        return
    known = {n: s.unit.dimension for n, s in module.signals.items()}
    known |= {n: p.unit.dimension for n, p in module.parameters.items()}
    gathered = dict(provided)
    for name in module.gathers:
        if name not in gathered:
            path = next(_gathering(document, module, name))
            hint = did_you_mean(name, provided)
            message = f"no module type provides '{name}'"
            found.append(Diagnostic(document.place(*path), "KB056", message, hint))
            return
    for definition in module.definitions.values():
        path = ("definitions", definition.name, "is")
        result = _dimension(document, path, definition.expression, known, gathered, found)
        if result is None:
            return
        known[definition.name] = result
    for observer in module.observers.values():
        path = ("observers", observer.name, "Q")
        result = _dimension(document, path, observer.expression, known, gathered, found)
        if result is not None and result != VOLUME_FLOW:
            message = f"an observer gives a volume flow ({VOLUME_FLOW}), but this is {result}"
            found.append(Diagnostic(document.place(*path), "KB057", message, "check each factor"))


def _gathering(document: Document, module: ModuleType, name: str) -> Iterator[tuple[str, str, str]]:
    for definition in module.definitions.values():
        if name in (n for n, _ in definition.expression.gathered()):
            yield "definitions", definition.name, "is"
    for observer in module.observers.values():
        if name in (n for n, _ in observer.expression.gathered()):
            yield "observers", observer.name, "Q"


def _dimension(
    document: Document,
    path: tuple[str | int, ...],
    expression: Expression,
    known: Mapping[str, Dimension],
    gathered: Mapping[str, Dimension],
    found: list[Diagnostic],
) -> Dimension | None:
    try:
        return dimension(expression, known, gathered)
    except Rejected as error:
        place = within(document.place(*path), error.column, error.length, expression.text)
        found.append(Diagnostic(place, error.code, error.message, error.hint))
        return None
