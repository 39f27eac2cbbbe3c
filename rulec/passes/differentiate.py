"""Pass 5, differentiate: symbolic work, once per module type.

It gives everything that a ruleset needs of a type in sympy: observers, targets of faults, slopes,
second derivatives, and the observers with all faults undone.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial

import sympy

from rulec.algebra.derivative import derivative, symbols_in
from rulec.knowledge.fluid import closed_forms
from rulec.knowledge.knowledge import (
    FaultType,
    Knowledge,
    Variant,
    adds,
    for_signal,
    has_no_zero,
    scales_from_zero,
)
from rulec.knowledge.liquid import Liquid
from rulec.knowledge.module_type import FaultUse, ModuleType, Signal
from rulec.knowledge.plant import Plant
from rulec.language.diagnostics import Diagnostic, Place, Refused
from rulec.language.expression import Expression
from rulec.language.symbolic import invert, to_sympy
from rulec.limits import ASSUMED_ACCURACY
from rulec.passes.liquid import ByTarget, liquid_id, moved_by

GATHERED = "downstream."
FLOW = "target.flow"
G = sympy.Symbol("g", real=True)
EXCESS = sympy.Symbol("D", real=True)
"""The faulty value, and its excess over the healthy one, in the rule of a degree."""

Gradient = Mapping[str, sympy.Expr]

Changes = Mapping[tuple[str, str], Sequence[Callable[[sympy.Expr], sympy.Expr]]]
"""Per place, (kind, name), the functions that lead one after the other to its changed value. Kinds
are ``signal``, ``parameter``, ``definition`` and ``observer``."""

PLAIN: Changes = {}
"""No place is changed."""


@dataclass(frozen=True, kw_only=True)
class Target:
    """The signal or definition that faults scale.

    `value` is its expression. `slopes` are d(observer)/d(target), `curvatures` their derivatives by
    the target itself; observers that do not use the target are absent. `inverse` gives the target
    from an observer's flow (symbol `FLOW`), if it can be solved. `driver` is the own signal through
    which the target moves. `whole` is the value without its constants: Eq. 16 of the seed paper
    refers to the whole pressure difference, including the static part.
    """

    name: str
    value: sympy.Expr
    slopes: Mapping[str, sympy.Expr]
    curvatures: Mapping[str, sympy.Expr]
    inverse: Mapping[str, sympy.Expr]
    driver: str | None
    whole: sympy.Expr


@dataclass(frozen=True)
class DegreeRule:
    """The degree X from the faulty value (``g``) and its excess (``D``).

    `by_excess` is dX/dD, `ratio` (dX/dg)/(dX/dD), `onset` dD/dx at degree 0.
    """

    degree: sympy.Expr
    by_excess: sympy.Expr
    ratio: sympy.Expr
    onset: sympy.Expr
    text: str


@dataclass(frozen=True)
class TypeFault:
    """A fault variant of a module type.

    `id` is local (``leakage``, ``dp.high``); `affects` are the observers that it makes wrong.
    """

    id: str
    fault: FaultType
    variant: Variant
    target: str
    affects: tuple[str, ...]
    rule: DegreeRule


@dataclass(frozen=True, kw_only=True)
class TypeModel:
    """A differentiated module type; its local variables are `symbols`, by name.

    `guards` are the values that must be positive for an observer to be defined, with their text.
    `unlisted` are errors of readings that only the sensor classes list. `margins` are those of the
    conditions of its regimes, such as ``reverse-flow:0``. `forms` are, by observer and law, the
    change of the observer's flow by one standard uncertainty of the law's form.
    """

    type: ModuleType
    symbols: Mapping[str, sympy.Symbol]
    observers: Mapping[str, sympy.Expr]
    guards: Mapping[str, tuple[tuple[str, sympy.Expr], ...]]
    targets: Mapping[str, Target]
    faults: tuple[TypeFault, ...]
    undone: Undone
    margins: Mapping[str, sympy.Expr]
    forms: Mapping[str, Mapping[str, sympy.Expr]]
    unlisted: tuple[TypeFault, ...] = ()

    def gradient(self, expression: sympy.Expr) -> Gradient:
        """Non-zero derivatives by local variable, worked out once for all modules of the type."""
        if expression not in self._gradients:
            used, by = symbols_in(expression), self.symbols.items()
            self._gradients[expression] = {n: derivative(expression, s) for n, s in by if s in used}
        return self._gradients[expression]

    @cached_property
    def gradients(self) -> Mapping[str, Gradient]:
        """Gradients of the observers."""
        return {name: self.gradient(e) for name, e in self.observers.items()}

    @cached_property
    def _gradients(self) -> dict[sympy.Expr, Gradient]:
        return {}


@dataclass(frozen=True, kw_only=True)
class Undone:
    """Observers and signals with all faults undone, as functions of degrees ``x.<fault id>``.

    `in_liquid` are the observers that a change of the liquid moves, with that change undone too;
    its degrees are named by full ids. `readings` are the signals with unlisted errors undone; all
    others are functions of them.
    """

    observers: Mapping[str, sympy.Expr]
    signals: Mapping[str, sympy.Expr]
    readings: Mapping[str, sympy.Expr]
    in_liquid: Mapping[str, sympy.Expr]


def differentiate(plant: Plant) -> dict[str, TypeModel]:
    """Differentiate all module types of the plant; models by key of the type.

    >>> from rulec.passes.pipeline import example
    >>> model = example("types").types["dosing-pcp"]
    >>> model.observers["pump"]
    -C0 - C1*n - C2*dp**2 + V*n
    >>> model.gradients["pump"]["dp"]
    -2*C2*dp
    """
    used = {module.type.key: module.type for module in plant.modules.values()}
    # Balances have listed faults only: each further one costs a simulation of every window.
    settled = not any(kind.states for kind in used.values())
    return {
        name: type_model(kind.settled(), plant.knowledge, any_error=settled)
        for name, kind in used.items()
    }


def type_model(kind: ModuleType, knowledge: Knowledge, *, any_error: bool = False) -> TypeModel:
    """All symbolic work on one module type; `any_error` includes errors that it does not list."""
    symbols = {name: _symbol(name) for name in (*kind.signals, *kind.parameters)}
    symbols |= {GATHERED + name: _symbol(GATHERED + name) for name in kind.gathers}
    observers = _observers(kind, symbols)
    for name, value in (*observers.items(), *written_out(kind, symbols).items()):
        if value.has(sympy.zoo, sympy.nan, sympy.oo, sympy.I):
            # Each part has a value alone, as in 1/(V - V): only together they have none.
            known = kind.observers.get(name)
            place = Place(kind.file, known.origin.line if known else 1)
            message = f"'{name}' of '{kind.name}' has no value, whatever the readings"
            hint = "it divides by zero, or takes the root or logarithm of what is never positive"
            raise Refused([Diagnostic(place, "KB041", message, hint)])
    over = partial(observers_over, kind, symbols=symbols, observers=observers)
    faults = tuple(_faults(kind, knowledge, over))
    further = tuple(unlisted_uses(kind, knowledge)) if any_error else ()
    unlisted = tuple(_faults(kind, knowledge, over, further)) if further else ()
    targets = {f.target: None for f in (*faults, *unlisted) if f.fault.acts_on != "flow"}
    return TypeModel(
        type=kind,
        symbols=symbols,
        observers=observers,
        guards={
            o.name: tuple(_guards(kind, o.expression, symbols)) for o in kind.observers.values()
        },
        targets={name: _target(kind, name, symbols, over) for name in targets},
        faults=faults,
        undone=_undone(kind, faults, unlisted, symbols, knowledge),
        margins=dict(_margins(kind, symbols)),
        forms=_forms(kind, symbols, over),
        unlisted=unlisted,
    )


def liquids_of(knowledge: Knowledge) -> Iterator[tuple[FaultType, Liquid]]:
    """Faults of the liquid."""
    for fault in knowledge.faults.values():
        if fault.liquid is not None:
            yield fault, fault.liquid


def liquid_ids(knowledge: Knowledge) -> tuple[str, ...]:
    """Ids of all variants of faults of the liquid."""
    return tuple(liquid_id(q, v.name) for fault, q in liquids_of(knowledge) for v in fault.variants)


def _margins(
    kind: ModuleType, symbols: Mapping[str, sympy.Symbol]
) -> Iterator[tuple[str, sympy.Expr]]:
    table = written_out(kind, symbols) if kind.regimes else {}
    for regime in kind.regimes.values():
        for i, condition in enumerate(regime.when):
            if not condition.signal:
                yield f"{regime.name}:{i}", _translated(kind, condition.margin, table)


def _forms(
    kind: ModuleType, symbols: Mapping[str, sympy.Symbol], over: ByTarget
) -> dict[str, dict[str, sympy.Expr]]:
    """What `TypeModel.forms` holds: no law obeys its formula exactly."""
    whole = {"observers": _observers(kind, symbols), "definitions": written_out(kind, symbols)}
    found: dict[str, dict[str, sympy.Expr]] = {name: {} for name in kind.observers}
    for (group, law), accuracy in kind.laws().items():
        value = whole[group][law]
        size = 0.5 * (accuracy.share if accuracy else ASSUMED_ACCURACY) * value
        if group == "observers":
            found[law][law] = size
        elif size:
            own, observers = over(law)
            for name, flow in observers.items():
                if own in symbols_in(flow):
                    change = derivative(flow, own).xreplace({own: value}) * size
                    found[name][law] = found[name].get(law, 0) + change
    return found


def _symbol(name: str) -> sympy.Symbol:
    return sympy.Symbol(name, real=True)


def _observers(
    kind: ModuleType, symbols: Mapping[str, sympy.Expr], changes: Changes = PLAIN
) -> dict[str, sympy.Expr]:
    """Observers over the local symbols, with changes."""
    table = written_out(kind, symbols, changes)
    plain = {o.name: _translated(kind, o.expression, table) for o in kind.observers.values()}
    return {name: _changed(changes, ("observer", name), e) for name, e in plain.items()}


def written_out(
    kind: ModuleType, symbols: Mapping[str, sympy.Expr], changes: Changes = PLAIN
) -> dict[str, sympy.Expr]:
    """Expressions by name, with changes, and with definitions written out."""
    table = {
        name: _changed(changes, ("signal" if name in kind.signals else "parameter", name), e)
        for name, e in symbols.items()
    }
    for name, definition in kind.definitions.items():  # in order of use
        plain = _translated(kind, definition.expression, table)
        table[name] = _changed(changes, ("definition", name), plain)
    return table


def _changed(changes: Changes, place: tuple[str, str], value: sympy.Expr) -> sympy.Expr:
    for change in changes.get(place, ()):
        value = change(value)
    return value


def _translated(
    kind: ModuleType, expression: Expression, table: Mapping[str, sympy.Expr]
) -> sympy.Expr:
    """An equation of a module type in sympy, with its downstream sums and fluid properties."""
    gathered = {name: table[GATHERED + name] for name in kind.gathers}
    return to_sympy(expression, table, gathered, closed_forms(kind.fluid, table))


def _guards(
    kind: ModuleType, expression: Expression, symbols: Mapping[str, sympy.Symbol]
) -> Iterator[tuple[str, sympy.Expr]]:
    """Arguments of roots and logarithms in an equation and its definitions, with original text."""
    table = written_out(kind, symbols)
    for part in kind.with_definitions(expression):
        for inner in part.guarded():
            text = ast.unparse(inner)
            yield text, _translated(kind, Expression(text, inner), table)


def observers_over(
    kind: ModuleType,
    target: str,
    symbols: Mapping[str, sympy.Symbol],
    observers: Mapping[str, sympy.Expr],
) -> tuple[sympy.Symbol, Mapping[str, sympy.Expr]]:
    """The symbol of a signal or definition, and the observers as functions of it."""
    if target in kind.signals:
        return symbols[target], observers
    own = _symbol(f"target.{target}")
    return own, _observers(kind, symbols, {("definition", target): (lambda _: own,)})


def _target(
    kind: ModuleType, name: str, symbols: Mapping[str, sympy.Symbol], over: ByTarget
) -> Target:
    own, observers = over(name)
    value = written_out(kind, symbols)[name]
    driver = next((s for s in kind.signals if symbols[s] in value.free_symbols), None)
    measured = {s for n, s in symbols.items() if n not in kind.parameters}
    uses = {o: e for o, e in observers.items() if own in symbols_in(e)}
    slopes = {o: derivative(e, own) for o, e in uses.items()}
    solved = {o: invert(e, own, _symbol(FLOW)) for o, e in uses.items()}
    return Target(
        name=name,
        value=value,
        slopes={o: e.xreplace({own: value}) for o, e in slopes.items()},
        curvatures={o: derivative(e, own).xreplace({own: value}) for o, e in slopes.items()},
        inverse={o: e for o, e in solved.items() if e is not None},
        driver=driver,
        whole=sympy.Add(*(t for t in sympy.Add.make_args(value) if t.free_symbols & measured)),
    )


def _faults(
    kind: ModuleType, knowledge: Knowledge, over: ByTarget, unlisted: Sequence[FaultUse] = ()
) -> Iterator[TypeFault]:
    """The faults that a module type lists, or those that are `unlisted`.

    The latter are named as if it listed them; its own faults keep the shorter names.
    """
    for use, variant, name in fault_names((*kind.faults, *unlisted), knowledge, kind.signals):
        fault, target = knowledge.fault_in(use), use.target
        if not unlisted or use in unlisted:
            affects = _affected(kind, fault, target, over)
            if affects or not unlisted or target in kind.provides.values():
                yield TypeFault(name, fault, variant, target, affects, _rule(fault, variant))


def unlisted_uses(kind: ModuleType, knowledge: Knowledge) -> Iterator[FaultUse]:
    """Faults of signals that a module type does not list, but the classes of its sensors.

    Shares of readings with an arbitrary zero, and sizes without a stated range, are left out.
    """
    for signal in kind.signals.values():
        for error in knowledge.sensors[signal.sensor].errors:
            use = FaultUse(error.fault, signal.name, error.place, error.frequency)
            fault = knowledge.faults[error.fault]
            shared = scales_from_zero(fault) and has_no_zero(signal, knowledge.units)
            if not (use in kind.faults or shared or (adds(fault) and not signal.full_scale)):
                yield use


def fault_names(
    declared: Iterable[FaultUse], knowledge: Knowledge, signals: Mapping[str, Signal]
) -> Iterator[tuple[FaultUse, Variant, str]]:
    """All variants of the faults of a module type, with their local ids."""
    uses = [(use, knowledge.fault_in(use)) for use in declared]
    shared = [fault.name for _, fault in uses if fault.acts_on != "signal"]
    shown = [(u.target, v.name) for u, f in uses if f.acts_on == "signal" for v in f.variants]
    for use, fault in uses:
        stem = use.target if fault.acts_on == "signal" else fault.name
        if fault.acts_on != "signal" and shared.count(fault.name) > 1:
            stem = f"{fault.name}.{use.target}"
        # Variants with names of their own are told apart without the name of the fault.
        own = [name for target, name in shown if target == use.target]
        several = len(own) > len(fault.variants) and len(own) > len(set(own) - {""})
        if fault.acts_on == "signal" and several:
            stem = f"{use.target}.{fault.name}"
        for variant in fault.variants:
            acting = for_signal(variant, signals.get(use.target), knowledge.units)
            yield use, acting, f"{stem}.{variant.name}" if variant.name else stem


def _affected(kind: ModuleType, fault: FaultType, target: str, over: ByTarget) -> tuple[str, ...]:
    """Own observers that use the target of a fault."""
    if fault.acts_on == "flow":
        return tuple(kind.components()[target])
    own, observers = over(target)
    return tuple(o for o, e in observers.items() if own in e.free_symbols)


def law_of(variant: Variant, g: sympy.Expr, x: sympy.Expr) -> sympy.Expr:
    """The law of a fault with its g and x replaced."""
    return to_sympy(variant.law, {"g": g, "x": x})


def _rule(fault: FaultType, variant: Variant) -> DegreeRule:
    """Solve the law of a fault for its degree.

    A flow fault takes effect after the observer, so the observer's flow is the healthy value; any
    other fault distorts what the observer reads.
    """
    g, D, x = G, EXCESS, _symbol("x")
    onset = derivative(law_of(variant, g, x), x).subs(x, 0)
    if fault.acts_on == "flow":
        solved, onset = invert(law_of(variant, g, x), x, g - D), -onset
    else:
        solved = invert(law_of(variant, g - D, x), x, g)
    assert solved is not None, "checked when the fault was read"
    degree = sympy.cancel(solved)
    by_excess = sympy.cancel(derivative(degree, D))
    ratio = sympy.cancel(derivative(degree, g) / by_excess)
    return DegreeRule(degree, by_excess, ratio, onset, sympy.sstr(degree, order="rev-lex"))


def _undone(
    kind: ModuleType,
    faults: tuple[TypeFault, ...],
    unlisted: tuple[TypeFault, ...],
    symbols: Mapping[str, sympy.Symbol],
    knowledge: Knowledge,
) -> Undone:
    """At degree 0 these are the plain observers; at the true degree they agree."""
    laws: dict[tuple[str, str], list[Callable[[sympy.Expr], sympy.Expr]]] = {}
    for fault in faults:
        acts_on = fault.fault.acts_on
        # A flow fault takes effect after the observers that it affects.
        of_flow = [("observer", o) for o in fault.affects]
        for place in of_flow if acts_on == "flow" else [(acts_on, fault.target)]:
            laws.setdefault(place, []).append(partial(_undo, fault))
    moves = _moves(kind, symbols, knowledge)
    both = {at: (*moves.get(at, ()), *laws.get(at, ())) for at in (*moves, *laws)}
    of_liquid = {degree_symbol(i) for i in liquid_ids(knowledge)}
    moved = _observers(kind, symbols, both) if moves else {}
    readings: dict[str, sympy.Expr] = {}
    for fault in unlisted:
        readings[fault.target] = _undo(fault, readings.get(fault.target, symbols[fault.target]))
    table = written_out(kind, symbols, laws)
    return Undone(
        observers=_observers(kind, symbols, laws),
        signals={name: table[name] for name in kind.signals},
        readings=readings,
        in_liquid={o: e for o, e in moved.items() if of_liquid & symbols_in(e)},
    )


def _moves(kind: ModuleType, symbols: Mapping[str, sympy.Symbol], knowledge: Knowledge) -> Changes:
    """What a change of the liquid does to the places that it moves."""
    table, observers = written_out(kind, symbols), _observers(kind, symbols)
    values = {("definition", n): table[n] for n in kind.definitions}
    values |= {("observer", n): e for n, e in observers.items()}
    over = partial(observers_over, kind, symbols=symbols, observers=observers)
    found: dict[tuple[str, str], list[Callable[[sympy.Expr], sympy.Expr]]] = {}
    for fault, liquid in liquids_of(knowledge):
        ratio = sympy.S.One
        for variant in fault.variants:
            x = degree_symbol(liquid_id(liquid, variant.name))
            ratio *= law_of(variant, sympy.S.One, x)
        for place, law in moved_by(liquid, kind, symbols, values, over, ratio):
            found.setdefault(place, []).append(law)
    return found


@cache
def degree_symbol(fault: str) -> sympy.Symbol:
    """Symbol of the degree of a fault, by its local id (a fault of the liquid: by its full id)."""
    return _symbol(f"x.{fault}")


def _undo(fault: TypeFault, there: sympy.Expr) -> sympy.Expr:
    """The healthy value from the faulty one and the degree."""
    return healthy(fault.variant, fault.fault.acts_on, there, degree_symbol(fault.id))


def healthy(variant: Variant, acts_on: str, there: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
    """The healthy value over the faulty one and the degree.

    A flow fault takes effect after the observer, whose flow is the healthy value: there it is the
    faulty value over the healthy one.
    """
    if acts_on == "flow":
        return law_of(variant, there, x)
    g, value = _symbol("g"), _symbol("value")
    solved = invert(law_of(variant, g, x), g, value)
    assert solved is not None, "checked when the fault was read"
    return solved.xreplace({value: there})
