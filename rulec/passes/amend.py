"""Build a law into a module type: the law replaces the plain value of a place and may use it.

A definition ``Q_law`` is renamed ``Q_law_plain``, and a new ``Q_law`` is the law over it. The
equation of an observer becomes a definition. A signal gets a new definition of its true reading,
which replaces the reading everywhere. The result is a module type like any other: it can be lowered
for the analysis, written as YAML, and compiled.
"""

import ast
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from rulec.knowledge.fluid import property_at
from rulec.knowledge.module_type import (
    ENDS,
    Accuracy,
    Definition,
    Fluid,
    ModuleType,
    Parameter,
    State,
)
from rulec.language.expression import (
    Expression,
    Rejected,
    name_node,
    over,
    replaced,
    text_of,
    written,
)
from rulec.passes.limits import MAX_STEM, SHORT_LAW


@dataclass(frozen=True, kw_only=True)
class Change:
    """A law to be built in at some places, each ``(kind, name)``.

    `kind` is ``definition``, ``observer``, ``signal``, ``balance`` (the derivative of a state),
    ``reading`` (what a sensor shows) or ``end`` (inflow or outflow). The law may use ``law`` (the
    plain value), `substitutes` (see `EffectLaw`), `drivers` (own signals and states, plan inputs
    such as ``B.T``, or a property of the `fluid` at one of these, as ``viscosity(T)``) and
    `parameters`, whose plan inputs are in `ids`. `also` lists further places with laws of their
    own. `states` are added to the type; all laws may use them.
    """

    places: tuple[tuple[str, str], ...]
    law: Expression
    drivers: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    ids: Mapping[str, str] = field(default_factory=dict)
    substitutes: Mapping[str, Mapping[str, Expression]] = field(default_factory=dict)
    also: tuple[tuple[tuple[str, str], Expression], ...] = ()
    states: Mapping[str, State] = field(default_factory=dict)
    fluid: Fluid | None = None

    def laws(self) -> Iterator[tuple[str, str, Expression]]:
        """All places with their laws, as (kind, name, law)."""
        yield from ((kind, place, self.law) for kind, place in self.places)
        yield from ((kind, place, law) for (kind, place), law in self.also)


@dataclass(frozen=True, kw_only=True)
class Amended:
    """A module type with changes built in.

    `inputs` maps added local parameters to plan inputs, `outside` local names to plan inputs that
    are no signals of the module, and `corrected` signals to the definitions of their true readings.
    `made` are the added definitions, `raw` those of them that use uncorrected readings.
    """

    type: ModuleType
    inputs: Mapping[str, str] = field(default_factory=dict)
    outside: Mapping[str, str] = field(default_factory=dict)
    corrected: Mapping[str, str] = field(default_factory=dict)
    made: frozenset[str] = frozenset()
    raw: frozenset[str] = frozenset()


def amend(amended: Amended, change: Change) -> Amended:
    """Build in one more change; raises `Rejected` if no equation can be written for it."""
    names: dict[str, ast.expr] = {}
    parameters, inputs = dict(amended.type.parameters), dict(amended.inputs)
    taken = _taken(amended)
    for name, parameter in change.parameters.items():
        local = fresh(name, taken)
        parameters[local] = replace(parameter, name=local)
        inputs[local] = change.ids[name]
        names[name] = name_node(local)
        taken.add(local)
    outside = dict(amended.outside)
    for driver, source in change.drivers.items():
        of_fluid, reading = property_at(source)
        if _is_own(amended.type, reading):
            there = amended.corrected.get(reading, reading)
        else:
            there = _outside(outside, reading, taken)
        if of_fluid:
            names[driver] = ast.Call(name_node(of_fluid), [name_node(there)], [])
        elif there in outside:
            names[driver] = name_node(there)
    for name in change.states:
        local = fresh(name, taken)
        names[name] = name_node(local)
        taken.add(local)
    fluid = amended.type.fluid or change.fluid
    kind = replace(amended.type, parameters=parameters, fluid=fluid)
    result = replace(amended, type=kind, inputs=inputs, outside=outside)
    for number, (place_kind, place, law) in enumerate(change.laws()):
        own = replace(change, law=law)
        if place_kind == "end" and place in result.type.definitions:
            place_kind = "definition"
        result, plain = _JOIN[place_kind](result, own, place, names)
        if number == 0:
            result = _with_states(result, change, names, plain)
    return result


def _is_own(kind: ModuleType, source: str) -> bool:
    return source in kind.signals or source in kind.states or (source in ENDS and kind.flows)


def _with_states(
    amended: Amended, change: Change, names: Mapping[str, ast.expr], plain: str
) -> Amended:
    """Add the states of a change, which may use the plain value of its first place."""
    if not change.states:
        return amended
    table = {**_own(amended, change), **names, "law": name_node(plain)}
    states = dict(amended.type.states)
    for name, state in change.states.items():
        local = names[name]
        assert isinstance(local, ast.Name)
        added = state.mapped(lambda e: written(replaced(e.tree, table)))
        states[local.id] = replace(added, name=local.id)
    return replace(amended, type=replace(amended.type, states=states))


def _outside(outside: dict[str, str], source: str, taken: set[str]) -> str:
    """Local name of a plan input of another module, added to `outside` if it is new."""
    for name, input_ in outside.items():
        if input_ == source:
            return name
    local = fresh(source.replace(".", "_"), taken)
    outside[local] = source
    taken.add(local)
    return local


def _taken(amended: Amended) -> set[str]:
    kind = amended.type
    names = {*kind.signals, *kind.parameters, *kind.definitions, *kind.observers, *kind.provides}
    return {*names, *kind.states, *ENDS, *amended.outside}


def fresh(name: str, taken: Iterable[str]) -> str:
    """The name, with a number appended if it is taken."""
    used, name = set(taken), name[:MAX_STEM]
    tried, count = name, 1
    while tried in used:
        count += 1
        tried = f"{name}_{count}"
    return tried


def _own(amended: Amended, change: Change) -> dict[str, ast.expr]:
    """Drivers that are the module's own, as their corrected values where there are any."""
    return {
        driver: name_node(amended.corrected.get(source, source))
        for driver, source in change.drivers.items()
        if _is_own(amended.type, source)
    }


Joined = tuple[Amended, str]
"""A type with a law built in, and the name of the plain value in it."""


def _join_definition(
    amended: Amended, change: Change, place: str, names: Mapping[str, ast.expr]
) -> Joined:
    old = amended.type.definitions[place]
    writer = _Writer(amended, {**_own(amended, change), **names}, place, old.expression)
    return writer.put_in(change), writer.plain


def _join_equation(
    group: str,
    part: str,
    title: str,
    amended: Amended,
    change: Change,
    place: str,
    names: Mapping[str, ast.expr],
) -> Joined:
    """The equation becomes a definition, and the law replaces it.

    `group` and `part` are the fields of the module type and of the place that hold the equation;
    `title` formats the stem of the definition's name.
    """
    places, name = getattr(amended.type, group), title.format(place)
    old: Expression = getattr(places[place], part)
    writer = _Writer(amended, {**_own(amended, change), **names}, name, old)
    there = {**places, place: replace(places[place], **{part: writer.law(change)})}
    plain = Definition(writer.plain, old, f"{name}, plain law")
    brought = {plain.name: plain, **writer.copies}
    changed: dict[str, Any] = {group: there, "definitions": {**amended.type.definitions, **brought}}
    kind = replace(amended.type, **changed)
    return replace(amended, type=kind, made=amended.made | brought.keys()), writer.plain


def _join_signal(
    amended: Amended, change: Change, place: str, names: Mapping[str, ast.expr]
) -> Joined:
    """The law of a sensor uses raw readings, so that corrections cannot depend on each other.

    Flows at ends that follow from the network are treated alike.
    """
    kind = amended.type
    raw = {d: name_node(s) for d, s in change.drivers.items() if _is_own(kind, s)}
    if place in amended.corrected:
        true = amended.corrected[place]
        old = kind.definitions[true]
        writer = _Writer(amended, {**raw, **names}, true, old.expression)
        result = writer.put_in(change)
        return replace(result, raw=result.raw | {writer.plain, *writer.copies}), writer.plain
    true = fresh(f"{place}_true", _taken(amended))
    law = written(replaced(change.law.tree, {**raw, **names, "law": name_node(place)}))
    what = f"what {place} should read" if place in kind.signals else f"{place}, repaired"
    kind = type_over(kind, {place: name_node(true)}, unchanged=amended.raw)
    exact = Accuracy(0.0, "the class of the sensor says it") if place in kind.signals else None
    kind = replace(kind, definitions={true: Definition(true, law, what, exact), **kind.definitions})
    joined = replace(
        amended,
        type=kind,
        corrected={**amended.corrected, place: true},
        made=amended.made | {true},
        raw=amended.raw | {true},
    )
    return joined, place


def type_over(
    kind: ModuleType, table: Mapping[str, ast.expr], unchanged: Container[str] = ()
) -> ModuleType:
    """A module type with names in its equations replaced, except in the definitions `unchanged`."""
    changed = partial(over, table=table)
    return replace(
        kind,
        definitions={
            n: d if n in unchanged else replace(d, expression=changed(d.expression))
            for n, d in kind.definitions.items()
        },
        observers={
            n: replace(o, expression=changed(o.expression)) for n, o in kind.observers.items()
        },
        states={n: s.mapped(changed) for n, s in kind.states.items()},
        readings={
            n: replace(r, expression=changed(r.expression)) for n, r in kind.readings.items()
        },
    )


_JOIN: Mapping[str, Callable[..., Joined]] = {
    "definition": _join_definition,
    "observer": partial(_join_equation, "observers", "expression", "{}"),
    "signal": _join_signal,
    "balance": partial(_join_equation, "states", "rate", "der_{}"),
    "reading": partial(_join_equation, "readings", "expression", "{}_shown"),
    "end": _join_signal,
}


class _Writer:
    """Writes the law of a change over the plain law of one place."""

    def __init__(
        self, amended: Amended, names: Mapping[str, ast.expr], place: str, old: Expression
    ) -> None:
        self._amended, self._names, self._place, self._old = amended, names, place, old
        self._taken = _taken(amended)
        self.plain = fresh(f"{place}_plain", self._taken)
        self._taken.add(self.plain)
        self.copies: dict[str, Definition] = {}

    def law(self, change: Change) -> Expression:
        table = {**self._names, "law": name_node(self.plain)}
        for key, drivers in change.substitutes.items():
            table[key] = self._substituted(change, drivers)
        return written(replaced(change.law.tree, table))

    def put_in(self, change: Change) -> Amended:
        """Put the law in place of a definition, which stays right before it under a new name."""
        kind, law = self._amended.type, self.law(change)
        old = kind.definitions[self._place]
        definitions: dict[str, Definition] = {}
        for name, definition in kind.definitions.items():
            if name == self._place:
                plain = Definition(self.plain, old.expression, f"{old.title}, plain law")
                definitions |= {self.plain: plain, **self.copies}
                definition = replace(old, expression=law)
            definitions[name] = definition
        made = self._amended.made | {self.plain, *self.copies}
        return replace(self._amended, type=replace(kind, definitions=definitions), made=made)

    def _substituted(self, change: Change, drivers: Mapping[str, Expression]) -> ast.expr:
        """The plain law with drivers replaced.

        A law built in before may be undefined there, such as friction over a flow of 0. The law
        beneath it is used then, which is the limit if the added term vanishes there.
        """
        taken, copies = set(self._taken), dict(self.copies)
        layers = list(self._layers())
        for name, law in layers:
            try:
                return written(self._replaced(change, drivers, name, law)).tree
            except Rejected:
                self._taken, self.copies = set(taken), dict(copies)
                if law is layers[-1][1]:
                    raise
        raise AssertionError("there is always the law itself")

    def _layers(self) -> Iterator[tuple[str, Expression]]:
        """The law, the one it was built over, and so on down to the author's own."""
        name, law = self._place, self._old
        stem = f"{self._place}_plain"[:MAX_STEM]
        while True:
            yield name, law
            made = (n for n, _ in law.names() if n in self._amended.made and n.startswith(stem))
            beneath = next(made, None)
            if beneath is None:
                return
            name, law = beneath, self._amended.type.definitions[beneath].expression

    def _replaced(
        self, change: Change, drivers: Mapping[str, Expression], place: str, law: Expression
    ) -> ast.expr:
        """A law with drivers replaced; definitions that it uses are written out or copied."""
        table: dict[str, ast.expr | None] = {}
        for driver, by in drivers.items():
            own = self._names[driver]
            assert isinstance(own, ast.Name), "checked when the effect was matched"
            table[own.id] = replaced(by.tree, self._names)
        shown = ", ".join(f"{driver}={by}" for driver, by in drivers.items())

        def copy(name: str, expression: Expression) -> ast.expr | None:
            """The changed tree; None if no replaced driver occurs in it."""
            for used, _ in expression.names():
                definition = self._amended.type.definitions.get(used)
                if used not in table and definition is not None:
                    table[used] = copy(used, definition.expression)
            inner = {n: t for n, _ in expression.names() if (t := table.get(n)) is not None}
            if not inner:
                return None
            return self._short(replaced(expression.tree, inner), name, shown)

        return copy(place, law) or name_node(self.plain if law is self._old else place)

    def _short(self, tree: ast.expr, name: str, shown: str) -> ast.expr:
        """The tree itself if it is short, else the name of a new definition for it."""
        if len(text_of(tree)) <= SHORT_LAW:
            return tree
        local = fresh(f"{name}_at", self._taken)
        self._taken.add(local)
        self.copies[local] = Definition(local, written(tree), f"{name} where {shown}")
        return name_node(local)
