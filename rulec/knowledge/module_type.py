"""What a maker says of a module, checked, in SI."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Self

from rulec.language.diagnostics import Place
from rulec.language.document import Path_
from rulec.language.expression import Expression
from rulec.language.origin import Origin
from rulec.language.units import Unit

INFLOW, OUTFLOW = "inflow", "outflow"
ENDS = (INFLOW, OUTFLOW)
"""Names, in a module type with states, of what flows in and out. A definition of such a name is a
law of the module; without one the flow follows from what is connected."""


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A constant of a module type, value and standard uncertainty in SI.

    It lies between `lowest` and `highest`. `shared`: its error is the same in all modules that have
    it.
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
        """Is it above zero by its meaning?"""
        return self.lowest >= 0.0 and self.value > 0.0

    @property
    def is_constant(self) -> bool:
        """Is it known exactly, and nothing to be found by a fit?"""
        return self.u == 0.0 and not self.fit


@dataclass(frozen=True)
class Accuracy:
    """How exact a law is: it keeps within this `share` of what it predicts in 19 of 20 places.

    Errors of sensors come on top. Half of the share is the standard uncertainty of its form.
    """

    share: float
    source: str

    @property
    def text(self) -> str:
        """As it stands in a file."""
        return f"{100 * self.share:g} %, {self.source}"


@dataclass(frozen=True)
class Definition:
    """A named part of an equation; `accuracy` is None where none is stated."""

    name: str
    expression: Expression
    title: str
    accuracy: Accuracy | None = None


@dataclass(frozen=True)
class Observer:
    """A relation read as an estimate of the volume flow; `accuracy` as of a definition."""

    name: str
    component: str
    expression: Expression
    is_reference: bool
    origin: Origin
    accuracy: Accuracy | None = None


_EQUATIONS = {"der": "rate", "start": "start", "low": "low", "high": "high", "after": "after"}
"""Equations of what is stored: key in a file, field here."""


@dataclass(frozen=True, kw_only=True)
class Stored:
    """How something that is stored moves; all equations, in SI.

    `rate` is its derivative by time, `start` its value at the beginning. It stays between `low` and
    `high`, where they are given. With `after` (s), a dead time, what it would follow as with a lag
    arrives all at once, so much later.
    """

    rate: Expression
    start: Expression
    low: Expression | None = None
    high: Expression | None = None
    after: Expression | None = None

    def equations(self) -> Iterator[tuple[str, Expression]]:
        """All of them by key, such as ``der``."""
        given = ((key, getattr(self, name)) for key, name in _EQUATIONS.items())
        yield from ((key, expression) for key, expression in given if expression is not None)

    def mapped(self, change: Callable[[Expression], Expression]) -> Self:
        """The same with every equation changed."""
        return replace(self, **{_EQUATIONS[key]: change(e) for key, e in self.equations()})


@dataclass(frozen=True, kw_only=True)
class State(Stored):
    """What a module stores. `quantity` is empty where no sensor measures such a thing."""

    name: str
    quantity: str
    unit: Unit
    title: str
    origin: Origin


@dataclass(frozen=True)
class Reading:
    """What a sensor shows, by the states: the equation of a signal that is no input."""

    name: str
    expression: Expression
    origin: Origin


@dataclass(frozen=True)
class Frequency:
    """How often a fault comes beside others, in one of the words of the contract."""

    word: str
    origin: Origin


@dataclass(frozen=True)
class FaultUse:
    """A fault that a module type can have, and what it acts on there.

    `frequency` is None where the module type does not say how often the fault comes in it.
    """

    fault: str
    target: str
    place: Place = field(compare=False)
    frequency: Frequency | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Property:
    """A property of a fluid over ``T``; `u` is the relative standard uncertainty of it."""

    name: str
    expression: Expression
    u: float
    origin: Origin


@dataclass(frozen=True, kw_only=True)
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
class Comparison:
    """A condition of a regime, `text` as its author wrote it.

    With a `signal` its reading lies above its minimum, or below it. Else `margin`, in SI, must be
    positive beyond its uncertainty.
    """

    text: str
    margin: Expression
    signal: str = ""
    above: bool = False


@dataclass(frozen=True, kw_only=True)
class Regime:
    """A way in which a module runs that its laws for delivering do not cover.

    All of its conditions must hold.
    """

    name: str
    title: str
    when: tuple[Comparison, ...]
    status: str
    text: str
    action: str
    origin: Origin

    def stands_on(self, names: Collection[str]) -> bool:
        """Are all names in its conditions among these?"""
        found = {name for c in self.when for name, _ in c.margin.names()}
        return found | {c.signal for c in self.when if c.signal} <= set(names)


@dataclass(frozen=True, kw_only=True)
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
    regimes: Mapping[str, Regime] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """What symbolic work is shared by: the type, and its fluid where it matters."""
        return f"{self.name} with {self.fluid.name}" if self.fluid else self.name

    @property
    def asks(self) -> tuple[str, ...]:
        """Properties of a fluid that the equations ask for."""
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

    def laws(self) -> dict[tuple[str, str], Accuracy | None]:
        """Places where the author chose a form, such as ``("definitions", "Q_law")``.

        A place is a law if it states an accuracy, or if an uncertain parameter stands in it. What a
        law stands on is a part of it, unless it states an accuracy; an observer that stands on such
        a part is none. A bare name, a meter, a sum of readings and a balance are no laws.
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
            for name in names:
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
        """Names in an equation and in all definitions that it stands on."""
        return {name for part in self.with_definitions(expression) for name, _ in part.names()}

    @property
    def read(self) -> set[str]:
        """Names that any equation reads."""
        return {name for part in self.equations() for name, _ in part.names()}

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
            return moving.isdisjoint(self.names_through(expression))

        definitions = {
            n: d for n, d in self.definitions.items() if n not in ENDS and still(d.expression)
        }
        kept = {*self.signals, *definitions, *self.components()}
        faults = tuple(use for use in self.faults if use.target in kept - self.readings.keys())
        known = {*self.signals, *self.parameters, *definitions}
        return replace(
            self,
            definitions=definitions,
            states={},
            readings={},
            faults=faults,
            regimes={n: r for n, r in self.regimes.items() if r.stands_on(known)},
        )

    def components(self) -> dict[str, list[str]]:
        """Observers of each component, the primary one first."""
        result: dict[str, list[str]] = {}
        for observer in self.observers.values():
            result.setdefault(observer.component, []).append(observer.name)
        return result
