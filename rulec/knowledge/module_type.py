"""A maker's description of a module, checked, in SI."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Self

from rulec.language.diagnostics import Origin, Place
from rulec.language.expression import Expression
from rulec.language.read_yaml import Path_
from rulec.language.units import Unit

INFLOW, OUTFLOW = "inflow", "outflow"
ENDS = (INFLOW, OUTFLOW)
"""Names of the flows in and out of a module type with states. A definition of that name is a law of
the module; without one the flow follows from the connected modules."""


@dataclass(frozen=True, kw_only=True)
class Signal:
    """A measured value of a module type; limits and reference in SI.

    `between` gives the course of an input between samples: ``hold`` or ``line``.
    """

    name: str
    quantity: str
    unit: Unit
    sensor: str
    full_scale: float | None = None
    lowest: float | None = None
    highest: float | None = None
    minimum: float | None = None
    reference: float | None
    is_input: bool
    between: str = "hold"


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A constant of a module type, value and standard uncertainty in SI.

    It lies between `lowest` and `highest`. If `shared`, its error is the same in all modules.
    """

    name: str
    value: float
    u: float = 0.0
    unit: Unit
    fit: bool = True
    title: str
    origin: Origin
    shared: bool = False
    lowest: float = -math.inf
    highest: float = math.inf

    @property
    def positive(self) -> bool:
        """Whether it can only be above zero."""
        return self.lowest >= 0.0 and self.value > 0.0

    @property
    def is_constant(self) -> bool:
        """Whether it is known exactly and never fitted."""
        return self.u == 0.0 and not self.fit


@dataclass(frozen=True)
class Accuracy:
    """Accuracy of a law: it is within this `share` of its prediction in 19 of 20 places.

    Sensor errors come on top. Half of the share is the standard uncertainty of the law's form.
    """

    share: float
    source: str

    @property
    def text(self) -> str:
        """The accuracy as written in a file."""
        return f"{100 * self.share:g} %, {self.source}"


@dataclass(frozen=True)
class Definition:
    """A named part of an equation; `accuracy` is None if not stated."""

    name: str
    expression: Expression
    title: str
    accuracy: Accuracy | None = None


@dataclass(frozen=True)
class Observer:
    """A relation solved for the volume flow; `accuracy` is None if not stated."""

    name: str
    component: str
    expression: Expression
    is_reference: bool
    origin: Origin
    accuracy: Accuracy | None = None


_EQUATIONS = {"der": "rate", "start": "start", "low": "low", "high": "high", "after": "after"}
"""Equations of a stored quantity: key in a file, field here."""


@dataclass(frozen=True, kw_only=True)
class Stored:
    """Equations of a stored quantity, in SI.

    `rate` is its derivative by time, `start` its initial value. It stays between `low` and `high`,
    if given. `after` (s) is a dead time: the value then follows undistorted after this delay,
    instead of with a lag.
    """

    rate: Expression
    start: Expression
    low: Expression | None = None
    high: Expression | None = None
    after: Expression | None = None

    def equations(self) -> Iterator[tuple[str, Expression]]:
        """All equations with their keys, such as ``der``."""
        given = ((key, getattr(self, name)) for key, name in _EQUATIONS.items())
        yield from ((key, expression) for key, expression in given if expression is not None)

    def names(self) -> set[str]:
        """Names in its equations."""
        return {name for _, e in self.equations() for name, _ in e.names()}

    def mapped(self, change: Callable[[Expression], Expression]) -> Self:
        """The same with every equation changed."""
        return replace(self, **{_EQUATIONS[key]: change(e) for key, e in self.equations()})


@dataclass(frozen=True, kw_only=True)
class State(Stored):
    """A stored quantity of a module; `quantity` is empty if no sensor can measure it."""

    name: str
    quantity: str
    unit: Unit
    title: str
    origin: Origin


@dataclass(frozen=True)
class Reading:
    """The equation by which the states determine a signal that is no input."""

    name: str
    expression: Expression
    origin: Origin


@dataclass(frozen=True)
class Frequency:
    """Frequency of a fault relative to others, as one of the words of the contract."""

    word: str
    origin: Origin


@dataclass(frozen=True)
class FaultUse:
    """A fault that a module type can have, and its target; `frequency` is None if not stated."""

    fault: str
    target: str
    place: Place = field(compare=False)
    frequency: Frequency | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Property:
    """A property of a fluid as a function of ``T``; `u` is its relative standard uncertainty."""

    name: str
    expression: Expression
    u: float
    origin: Origin


@dataclass(frozen=True, kw_only=True)
class Fluid:
    """A liquid, all in SI.

    The equations of its properties use the temperature ``T``, `coefficients` and `definitions`;
    each definition may use those before it. They hold from `lowest` to `highest`, in K.
    """

    name: str
    title: str
    lowest: float
    highest: float
    coefficients: Mapping[str, float]
    definitions: Mapping[str, Expression]
    properties: Mapping[str, Property]


@dataclass(frozen=True)
class Comparison:
    """A condition of a regime, with its original `text`.

    With a `signal`, its reading must be above (or below) its minimum. Otherwise `margin`, in SI,
    must be positive beyond its uncertainty.
    """

    text: str
    margin: Expression
    signal: str = ""
    above: bool = False


@dataclass(frozen=True, kw_only=True)
class Regime:
    """An operating regime that a module's laws do not cover; all of its conditions must hold."""

    name: str
    title: str
    when: tuple[Comparison, ...]
    status: str
    text: str
    action: str
    origin: Origin

    def stands_on(self, names: Collection[str]) -> bool:
        """Whether its conditions use only these names."""
        found = {name for c in self.when for name, _ in c.margin.names()}
        return found | {c.signal for c in self.when if c.signal} <= set(names)


@dataclass(frozen=True, kw_only=True)
class ModuleType:
    """A maker's complete description of a module; definitions are in order of use.

    `fluid` is the fluid whose properties its equations use, if any; `instruments` is what a plant
    states of the sensors of an instance, as text.
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
    regimes: Mapping[str, Regime] = field(default_factory=dict)
    instruments: str = ""

    @property
    def key(self) -> str:
        """Key by which symbolic work is shared: the type, its fluid if equations use it, and the
        sensors of the instance."""
        parts = (self.name, self.fluid.name if self.fluid else "", self.instruments)
        return " with ".join(filter(None, parts))

    @property
    def asks(self) -> tuple[str, ...]:
        """Fluid properties that the equations use."""
        return tuple(sorted({name for e in self.equations() for name, _ in e.properties()}))

    def equations_at(self) -> Iterator[tuple[Path_, Expression]]:
        """All equations with their paths in the file, such as ``("observers", "pump", "Q")``."""
        for definition in self.definitions.values():
            yield ("definitions", definition.name, "is"), definition.expression
        for observer in self.observers.values():
            yield ("observers", observer.name, "Q"), observer.expression
        for state in self.states.values():
            for key, expression in state.equations():
                yield ("states", state.name, key), expression
        for reading in self.readings.values():
            yield ("readings", reading.name, "is"), reading.expression

    def equations(self) -> list[Expression]:
        """Equations of all definitions, observers, states and readings."""
        return [expression for _, expression in self.equations_at()]

    def with_definitions(self, expression: Expression) -> Iterator[Expression]:
        """An equation and those of all definitions it uses, directly or not."""
        seen: set[str] = set()
        stack = [expression]
        while stack:
            part = stack.pop()
            yield part
            for name, _ in part.names():
                if name in self.definitions and name not in seen:
                    seen.add(name)
                    stack.append(self.definitions[name].expression)

    def laws(self) -> dict[tuple[str, str], Accuracy | None]:
        """Accuracy of each place where the author chose a form, as ``("definitions", "Q_law")``.

        A place is a law if it states an accuracy or contains an uncertain parameter. A definition
        that a law uses is part of that law, unless it states an accuracy itself; an observer that
        uses such a definition is no law. Bare names, meters, sums of readings and balances are no
        laws.
        """
        found: dict[tuple[str, str], Accuracy | None] = {}
        uncertain = {p.name for p in self.parameters.values() if not p.is_constant}

        def visit(path: tuple[str, str], part: Definition | Observer, inside: bool = False) -> None:
            names = {name for name, _ in part.expression.names()}
            below = self.names_through(part.expression) & self.definitions.keys()
            stated = [a for name in below if (a := self.definitions[name].accuracy)]
            own = bool(names & uncertain)
            if isinstance(part, Observer):
                own &= not part.is_reference and not any(a.share for a in stated)
            if part.accuracy or (own and not inside):
                found[path] = part.accuracy
            descend(names, inside or path in found)

        def descend(names: Iterable[str], inside: bool = False) -> None:
            for name in sorted(names):  # a set has no order of its own
                if name in self.definitions:
                    visit(("definitions", name), self.definitions[name], inside)

        for observer in self.observers.values():
            visit(("observers", observer.name), observer)
        descend(ENDS)
        for path, expression in self.equations_at():
            if path[0] in ("states", "readings"):
                descend(name for name, _ in expression.names())
        return found

    def names_through(self, expression: Expression) -> set[str]:
        """Names in an equation and in all definitions it uses, directly or not."""
        return {name for part in self.with_definitions(expression) for name, _ in part.names()}

    def reached(self, *groups: str) -> set[str]:
        """Names that equations of some groups and laws of flows use, directly or not."""
        laws = [("definitions", end) for end in ENDS]
        found = (e for path, e in self.equations_at() if path[0] in groups or path[:2] in laws)
        return {name for expression in found for name in self.names_through(expression)}

    @property
    def read(self) -> set[str]:
        """Names that any equation reads."""
        return {name for part in self.equations() for name, _ in part.names()}

    @property
    def cuts(self) -> bool:
        """Whether inflow and outflow may differ: it stores, or a flow has a law of its own."""
        return bool(self.states) or any(end in self.definitions for end in ENDS)

    @property
    def flows(self) -> bool:
        """Whether its equations can use inflow and outflow."""
        return self.cuts or bool(self.readings)

    def settled(self) -> ModuleType:
        """The part that holds at each moment: without states and all that uses them."""
        if not self.flows:
            return self
        moving = {*self.states, *ENDS}

        def still(expression: Expression) -> bool:
            return moving.isdisjoint(self.names_through(expression))

        definitions = {
            n: d for n, d in self.definitions.items() if n not in ENDS and still(d.expression)
        }
        targets = {*self.signals, *definitions, *self.components()}
        faults = tuple(use for use in self.faults if use.target in targets - self.readings.keys())
        names = {*self.signals, *self.parameters, *definitions}
        return replace(
            self,
            definitions=definitions,
            states={},
            readings={},
            faults=faults,
            regimes={n: r for n, r in self.regimes.items() if r.stands_on(names)},
        )

    def components(self) -> dict[str, list[str]]:
        """Observers of each component, the primary one first."""
        result: dict[str, list[str]] = {}
        for observer in self.observers.values():
            result.setdefault(observer.component, []).append(observer.name)
        return result
