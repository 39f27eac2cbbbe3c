"""What is true of equipment in general: the checked content of kb/, in SI."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from rulec.language.diagnostics import Place
from rulec.language.expression import Expression
from rulec.language.units import Unit, UnitTable

PLAIN = "law"
"""Name of the plain law in the law of an effect."""

INFLOW, OUTFLOW = "inflow", "outflow"
ENDS = (INFLOW, OUTFLOW)
"""Names, in a module type with states, of what flows in and out. A definition of such a name is a
law of the module; without one the flow follows from what is connected."""


@dataclass(frozen=True)
class Origin:
    """Where a derived value comes from: file, line and citation."""

    file: str
    line: int
    source: str = ""


@dataclass(frozen=True)
class SensorClass:
    """Systematic uncertainty of a class of sensors.

    `kind` is ``full scale`` or ``reading`` (then `standard` is a fraction) or ``value`` (then
    `standard` is in SI); `standard` is the standard uncertainty, bound over coverage factor.
    `cost` is what one more of them costs, fitted, relative to the other classes; `measures` the
    quantity for which advice may propose it where no signal is declared.
    """

    name: str
    title: str
    kind: str
    standard: float
    unit: Unit
    cost: float
    measures: str
    origin: Origin

    def uncertainty(self, full_scale: float | None, reading: float) -> float:
        """Standard uncertainty of a reading, SI."""
        size = {"full scale": full_scale or 0.0, "reading": abs(reading), "value": 1.0}
        return self.standard * size[self.kind]


@dataclass(frozen=True)
class Signal:
    """A measured value of a module type; limits and reference in SI.

    `between` says how an input runs between samples: ``hold`` or ``line``.
    """

    name: str
    quantity: str
    unit: Unit
    sensor: str
    full_scale: float | None
    lowest: float | None
    highest: float | None
    minimum: float | None
    reference: float | None
    is_input: bool
    between: str = "hold"


@dataclass(frozen=True)
class Parameter:
    """A constant of a module type, value and standard uncertainty in SI.

    `shared` tells that its error is one and the same in all modules that have it.
    """

    name: str
    value: float
    u: float
    unit: Unit
    fit: bool
    title: str
    origin: Origin
    shared: bool = False


@dataclass(frozen=True)
class Definition:
    """A named part of an equation."""

    name: str
    expression: Expression
    title: str


@dataclass(frozen=True)
class Observer:
    """A relation read as an estimate of the volume flow."""

    name: str
    component: str
    expression: Expression
    is_reference: bool
    origin: Origin


@dataclass(frozen=True)
class State:
    """What a module stores: `rate` is its derivative by time, `start` its value at the beginning.

    It stays between `low` and `high`, where they are given; all equations, in SI. `quantity` is
    empty where no sensor measures such a thing. With `after` (s), a dead time, what the state
    would follow as with a lag arrives all at once, so much later.
    """

    name: str
    quantity: str
    unit: Unit
    title: str
    rate: Expression
    start: Expression
    low: Expression | None
    high: Expression | None
    origin: Origin
    after: Expression | None = None

    def equations(self) -> Iterator[tuple[str, Expression]]:
        """All of them by key."""
        yield "der", self.rate
        yield "start", self.start
        if self.low is not None:
            yield "low", self.low
        if self.high is not None:
            yield "high", self.high
        if self.after is not None:
            yield "after", self.after


@dataclass(frozen=True)
class Reading:
    """What a sensor shows, by the states: the equation of a signal that is no input."""

    name: str
    expression: Expression
    origin: Origin


@dataclass(frozen=True)
class FaultUse:
    """A fault that a module type can have, and what it acts on there."""

    fault: str
    target: str
    place: Place = field(compare=False)


@dataclass(frozen=True)
class Property:
    """A property of a fluid over ``T``; `u` is the relative standard uncertainty of it."""

    name: str
    expression: Expression
    u: float
    origin: Origin


@dataclass(frozen=True)
class Fluid:
    """A liquid, all in SI.

    The equations of its properties stand over the temperature ``T``, `coefficients`, and
    `definitions`, each over what comes before it. They hold from `lowest` to `highest`, in K.
    """

    name: str
    title: str
    lowest: float
    highest: float
    coefficients: Mapping[str, float]
    definitions: Mapping[str, Expression]
    properties: Mapping[str, Property]


@dataclass(frozen=True)
class ModuleType:
    """Everything a maker says of a module. Definitions are in order of use.

    `fluid` is what its equations are filled with, where they ask for properties of one.
    """

    name: str
    version: int
    title: str
    signals: Mapping[str, Signal]
    provides: Mapping[str, str]
    parameters: Mapping[str, Parameter]
    definitions: Mapping[str, Definition]
    observers: Mapping[str, Observer]
    residuals: tuple[tuple[str, str], ...]
    faults: tuple[FaultUse, ...]
    gathers: tuple[str, ...]
    file: str
    fluid: Fluid | None = None
    states: Mapping[str, State] = field(default_factory=dict)
    readings: Mapping[str, Reading] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """What symbolic work is shared by: the type, and its fluid where it matters."""
        return f"{self.name} with {self.fluid.name}" if self.fluid else self.name

    @property
    def asks(self) -> tuple[str, ...]:
        """Properties of a fluid that the equations ask for."""
        return tuple(sorted({name for e in self.equations() for name, _ in e.properties()}))

    def equations(self) -> list[Expression]:
        """Equations of all definitions, observers, states and readings."""
        return [
            *(d.expression for d in self.definitions.values()),
            *(o.expression for o in self.observers.values()),
            *(e for state in self.states.values() for _, e in state.equations()),
            *(r.expression for r in self.readings.values()),
        ]

    def with_definitions(self, expression: Expression) -> Iterator[Expression]:
        """An equation and those of all definitions that it stands on."""
        seen: set[str] = set()
        stack = [expression]
        while stack:
            part = stack.pop()
            yield part
            for name, _ in part.names():
                if name in self.definitions and name not in seen:
                    seen.add(name)
                    stack.append(self.definitions[name].expression)

    @property
    def cuts(self) -> bool:
        """Need what flows in not flow out: does it store, or has a flow a law of its own?"""
        return bool(self.states) or any(end in self.definitions for end in ENDS)

    @property
    def flows(self) -> bool:
        """Do its equations know what flows in and out?"""
        return self.cuts or bool(self.readings)

    def settled(self) -> ModuleType:
        """What holds without time: no states, and nothing that stands on one."""
        if not self.flows:
            return self
        moving = {*self.states, *ENDS}

        def still(expression: Expression) -> bool:
            parts = self.with_definitions(expression)
            return not any(name in moving for part in parts for name, _ in part.names())

        definitions = {
            n: d for n, d in self.definitions.items() if n not in ENDS and still(d.expression)
        }
        kept = {*self.signals, *definitions, *self.components()}
        faults = tuple(use for use in self.faults if use.target in kept - self.readings.keys())
        return replace(self, definitions=definitions, states={}, readings={}, faults=faults)

    def components(self) -> dict[str, list[str]]:
        """Observers of each component, the primary one first."""
        result: dict[str, list[str]] = {}
        for observer in self.observers.values():
            result.setdefault(observer.component, []).append(observer.name)
        return result


@dataclass(frozen=True)
class Variant:
    """One direction of a fault: `law` gives what is there from what should be there."""

    name: str
    title: str
    law: Expression
    lowest: float
    highest: float
    meaning: str


@dataclass(frozen=True)
class FaultType:
    """What a fault does; sign, gain, rule and matrix row are derived from it."""

    name: str
    title: str
    acts_on: str
    variants: tuple[Variant, ...]
    tolerance: float
    status: str
    text: str
    action: str
    origin: Origin


@dataclass(frozen=True)
class Driver:
    """A reading that an effect depends on, by quantity.

    `where` is ``own`` (a signal of the module), ``plant`` (own, or else of any module) or
    ``downstream`` (a signal of the module behind, as in ``downstream(name)``). The quantity
    ``time`` means seconds since the beginning of the recording.
    """

    name: str
    quantity: str
    where: str
    title: str


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect; numbers in SI.

    At `null` the plain relation comes back; None where the parameter only shapes the term.
    `starts` are values to try, `quantiles` quantiles of the readings of `driver` to try. `fixed`:
    no unknown, but the median reading of `driver`; where `neutral`, the plain law holds at that
    reading, whatever the other parameters are.
    """

    name: str
    title: str
    unit: Unit
    null: float | None
    lowest: float
    highest: float
    starts: tuple[float, ...]
    quantiles: tuple[float, ...]
    driver: str | None
    fixed: bool
    neutral: bool = False


@dataclass(frozen=True)
class Join:
    """A kind of place that an effect can join, and the law it has there.

    One of these is set: `reads` (a signal of this quantity, ``any`` for all), `gives` (a definition
    or observer of this quantity), and in modules that store `stores` (the derivative of a state of
    this quantity), `shows` (what a sensor of this quantity shows, or ``any``), `flows` (``in`` or
    ``out``). `falls_with`, `rises_with` name a driver and the sign of the
    slope by it at the reference point; `measured` asks for places that read a signal of the very
    quantity they give (a processed reading), else those are left out. `steep`: a rise of that
    driver by a share changes what is given by more (True) or less (False) than half that share;
    None: either. A place that gives a flow counts only where an estimate of the module's flow
    rises with it: a slip, which is subtracted, is no estimate. `law` stands over ``law``,
    ``law(driver=...)``, drivers and parameters; only those that occur there, in `falls_with` and
    `rises_with`, or as the `driver` of such a parameter, are needed to join. `also` gives what
    flows ``in`` or ``out`` a law besides.
    """

    reads: str
    gives: str
    falls_with: str
    rises_with: str
    measured: bool
    law: EffectLaw
    steep: bool | None = None
    stores: str = ""
    shows: str = ""
    flows: str = ""
    also: Mapping[str, EffectLaw] = field(default_factory=dict)

    @property
    def laws(self) -> tuple[EffectLaw, ...]:
        """The law of the place, then those of further flows."""
        return (self.law, *self.also.values())


@dataclass(frozen=True)
class EffectLaw:
    """What a place becomes: `expression` over drivers, parameters, ``law`` and `substitutes`.

    ``law(dp=0)`` is read as the name of an entry of `substitutes`: which driver of the plain law
    is replaced by what.
    """

    text: str
    expression: Expression
    substitutes: Mapping[str, Mapping[str, Expression]]

    def names(self) -> set[str]:
        """Drivers and parameters that it speaks of, also where it asks for the plain law."""
        found = {name for name, _ in self.expression.names()} - {PLAIN, *self.substitutes}
        for replaced in self.substitutes.values():
            found |= replaced.keys()
            found |= {name for value in replaced.values() for name, _ in value.names()}
        return found


@dataclass(frozen=True)
class EffectState:
    """Something that an effect stores, of the kind of its place; equations as in its law.

    `after` as in `State`.
    """

    rate: Expression
    start: Expression
    low: Expression | None
    high: Expression | None
    after: Expression | None

    def equations(self) -> Iterator[tuple[str, Expression]]:
        """All of them by key."""
        given = {"der": self.rate, "start": self.start, "low": self.low, "high": self.high}
        given["after"] = self.after
        yield from ((key, e) for key, e in given.items() if e is not None)

    def names(self) -> set[str]:
        """Names in them."""
        return {name for _, e in self.equations() for name, _ in e.names()}


@dataclass(frozen=True)
class Effect:
    """Physics, ageing or a sensor error that a relation may leave out; `sort` says which."""

    name: str
    title: str
    sort: str
    joins: tuple[Join, ...]
    drivers: Mapping[str, Driver]
    parameters: Mapping[str, EffectParameter]
    regime: str
    text: str
    action: str
    origin: Origin
    states: Mapping[str, EffectState] = field(default_factory=dict)

    def used_by(self, join: Join) -> set[str]:
        """Drivers and parameters that a join speaks of, also by way of states."""
        found = {name for law in join.laws for name in law.names()}
        found |= {name for state in self.states.values() for name in state.names()}
        return found - {PLAIN, *self.states}


@dataclass(frozen=True)
class Knowledge:
    """The checked knowledge base."""

    units: UnitTable
    sensors: Mapping[str, SensorClass]
    faults: Mapping[str, FaultType]
    modules: Mapping[str, ModuleType]
    fluids: Mapping[str, Fluid]
    effects: Mapping[str, Effect] = field(default_factory=dict)
