"""Pass 5, differentiate: symbolic work, once per module type.

Everything a ruleset needs of a type in sympy: observers, what each fault scales, slopes,
second derivatives, and the observers with all faults undone.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import sympy

from rulec.knowledge.degree_unit import for_signal
from rulec.knowledge.fluid import closed_forms
from rulec.knowledge.knowledge import FaultType, Knowledge, Variant
from rulec.knowledge.module_type import FaultUse, ModuleType, Signal
from rulec.knowledge.plant import Plant
from rulec.language.expression import Expression
from rulec.language.invert import invert
from rulec.language.symbolic import to_sympy

GATHERED = "downstream."
FLOW = "target.flow"
G = sympy.Symbol("g", real=True)
EXCESS = sympy.Symbol("D", real=True)
"""What is there, and what is there too much, in the rule of a degree."""

Gradient = Mapping[str, sympy.Expr]


@dataclass(frozen=True, kw_only=True)
class Target:
    """What faults scale: a signal or a definition.

    `value` is its expression, `gradient` d(value)/d(local variable). `slopes` is
    d(observer)/d(target), `slope_gradients` their derivatives by local variables, `curvatures`
    by the target itself; observers that do not read the target are absent. `inverse` gives the
    target from an observer's flow (symbol `FLOW`), where sympy can. `driver` is the own signal
    through which the target moves. `whole` is the value without the constants in it: Eq. 16 of
    the seed paper relates to the whole pressure difference, static part included.
    """

    name: str
    value: sympy.Expr
    gradient: Gradient
    slopes: Mapping[str, sympy.Expr]
    slope_gradients: Mapping[str, Gradient]
    curvatures: Mapping[str, sympy.Expr]
    inverse: Mapping[str, sympy.Expr]
    driver: str | None
    whole: sympy.Expr
    whole_gradient: Gradient


@dataclass(frozen=True)
class DegreeRule:
    """The degree X from what is there (``g``) and what is there too much (``D``).

    `by_excess` is dX/dD, `ratio` (dX/dg)/(dX/dD), `onset` dD/dx at degree 0.
    """

    degree: sympy.Expr
    by_excess: sympy.Expr
    ratio: sympy.Expr
    onset: sympy.Expr
    text: str


@dataclass(frozen=True, kw_only=True)
class TypeFault:
    """A fault variant of a module type.

    `id` is local (``leakage``, ``dp.high``), `affects` the observers made wrong.
    """

    id: str
    fault: FaultType
    variant: Variant
    target: str
    affects: tuple[str, ...]
    rule: DegreeRule


@dataclass(frozen=True)
class Condition:
    """This must be positive for an observer to exist."""

    text: str
    value: sympy.Expr


@dataclass(frozen=True, kw_only=True)
class TypeModel:
    """A module type differentiated; local variables are its symbols by name."""

    type: ModuleType
    symbols: Mapping[str, sympy.Symbol]
    observers: Mapping[str, sympy.Expr]
    gradients: Mapping[str, Gradient]
    guards: Mapping[str, tuple[Condition, ...]]
    targets: Mapping[str, Target]
    faults: tuple[TypeFault, ...]
    undone: Undone


@dataclass(frozen=True)
class Undone:
    """Observers and signals with all faults undone, as functions of degrees ``x.<fault id>``.

    `slopes` is d(observer)/d(degree), `signal_slopes` d(signal)/d(degree), `gather_slopes`
    d(observer)/d(gathered name); absent where zero.
    """

    observers: Mapping[str, sympy.Expr]
    signals: Mapping[str, sympy.Expr]
    slopes: Mapping[tuple[str, str], sympy.Expr]
    signal_slopes: Mapping[tuple[str, str], sympy.Expr]
    gather_slopes: Mapping[tuple[str, str], sympy.Expr]


def differentiate(plant: Plant) -> dict[str, TypeModel]:
    """Differentiate every module type that the plant uses; models by key of the type.

    >>> from rulec.passes.pipeline import example
    >>> model = example("types").types["dosing-pcp"]
    >>> model.observers["pump"]
    -C0 - C1*n - C2*dp**2 + V*n
    >>> model.gradients["pump"]["dp"]
    -2*C2*dp
    """
    used = {module.type.key: module.type for module in plant.modules.values()}
    return {name: type_model(kind.settled(), plant.knowledge) for name, kind in used.items()}


def type_model(kind: ModuleType, knowledge: Knowledge) -> TypeModel:
    """All symbolic work on one module type."""
    symbols = {name: _symbol(name) for name in (*kind.signals, *kind.parameters)}
    symbols |= {GATHERED + name: _symbol(GATHERED + name) for name in kind.gathers}
    observers = _observers(kind, symbols, {})
    faults = tuple(_faults(kind, knowledge, symbols, observers))
    targets = {f.target: None for f in faults if f.fault.acts_on != "flow"}
    return TypeModel(
        type=kind,
        symbols=symbols,
        observers=observers,
        gradients={name: _gradient(e, symbols) for name, e in observers.items()},
        guards={
            o.name: tuple(_guards(kind, o.expression, symbols)) for o in kind.observers.values()
        },
        targets={name: _target(kind, name, symbols, observers) for name in targets},
        faults=faults,
        undone=_undone(kind, faults, symbols),
    )


def _symbol(name: str) -> sympy.Symbol:
    return sympy.Symbol(name, real=True)


def _observers(
    kind: ModuleType,
    symbols: Mapping[str, sympy.Expr],
    replaced: Mapping[str, sympy.Expr],
) -> dict[str, sympy.Expr]:
    """Observers over the local symbols; `replaced` keeps some definitions as given."""
    table = written_out(kind, symbols, replaced)
    return {
        o.name: _translated(kind, o.expression, table, symbols) for o in kind.observers.values()
    }


def written_out(
    kind: ModuleType, symbols: Mapping[str, sympy.Expr], replaced: Mapping[str, sympy.Expr]
) -> dict[str, sympy.Expr]:
    """Names to expressions, definitions written out (they stand in order of use)."""
    table = dict(symbols)
    for name, definition in kind.definitions.items():
        if name in replaced:
            table[name] = replaced[name]
        else:
            table[name] = _translated(kind, definition.expression, table, symbols)
    return table


def _translated(
    kind: ModuleType,
    expression: Expression,
    table: Mapping[str, sympy.Expr],
    symbols: Mapping[str, sympy.Expr],
) -> sympy.Expr:
    """An equation of a module type in sympy, with what it gathers and its fluid's properties."""
    gathered = {name: symbols[GATHERED + name] for name in kind.gathers}
    return to_sympy(expression, table, gathered, closed_forms(kind.fluid, symbols))


def _gradient(expression: sympy.Expr, symbols: Mapping[str, sympy.Symbol]) -> dict[str, sympy.Expr]:
    """Non-zero derivatives by local variable."""
    free = expression.free_symbols
    return {n: sympy.diff(expression, s) for n, s in symbols.items() if s in free}


def _guards(
    kind: ModuleType, expression: Expression, symbols: Mapping[str, sympy.Symbol]
) -> Iterator[Condition]:
    """Arguments of roots and logarithms, through all definitions used, as the author wrote them."""
    table = written_out(kind, symbols, {})
    for part in kind.with_definitions(expression):
        for inner in part.guarded():
            text = ast.unparse(inner)
            yield Condition(text, _translated(kind, Expression(text, inner), table, symbols))


def opened(
    kind: ModuleType,
    target: str,
    symbols: Mapping[str, sympy.Symbol],
    observers: Mapping[str, sympy.Expr],
) -> tuple[sympy.Symbol, Mapping[str, sympy.Expr]]:
    """The symbol of a signal or definition, and the observers over it."""
    if target in kind.signals:
        return symbols[target], observers
    own = _symbol(f"target.{target}")
    return own, _observers(kind, symbols, {target: own})


def _target(
    kind: ModuleType,
    name: str,
    symbols: Mapping[str, sympy.Symbol],
    observers: Mapping[str, sympy.Expr],
) -> Target:
    """Differentiate all observers by a target that faults scale."""
    own, over = opened(kind, name, symbols, observers)
    value = written_out(kind, symbols, {})[name]
    driver = next((s for s in kind.signals if symbols[s] in value.free_symbols), None)
    back = {own: value}
    measured = {s for n, s in symbols.items() if n not in kind.parameters}
    whole = sympy.Add(*(t for t in sympy.Add.make_args(value) if t.free_symbols & measured))
    slopes, curvatures, inverse = {}, {}, {}
    flow = _symbol(FLOW)
    for observer, expression in over.items():
        if own not in expression.free_symbols:
            continue
        slope = sympy.diff(expression, own)
        slopes[observer] = slope.xreplace(back)
        curvatures[observer] = sympy.diff(slope, own).xreplace(back)
        solved = invert(expression, own, flow)
        if solved is not None:
            inverse[observer] = solved
    return Target(
        name=name,
        value=value,
        gradient=_gradient(value, symbols),
        slopes=slopes,
        slope_gradients={o: _gradient(slope, symbols) for o, slope in slopes.items()},
        curvatures=curvatures,
        inverse=inverse,
        driver=driver,
        whole=whole,
        whole_gradient=_gradient(whole, symbols),
    )


def _faults(
    kind: ModuleType,
    knowledge: Knowledge,
    symbols: Mapping[str, sympy.Symbol],
    observers: Mapping[str, sympy.Expr],
) -> Iterator[TypeFault]:
    for use, variant, name in fault_names(kind.faults, knowledge, kind.signals):
        fault = knowledge.fault_in(use)
        affects = _affected(kind, fault, use.target, symbols, observers)
        yield TypeFault(
            id=name,
            fault=fault,
            variant=variant,
            target=use.target,
            affects=affects,
            rule=_rule(fault, variant),
        )


def fault_names(
    declared: Iterable[FaultUse], knowledge: Knowledge, signals: Mapping[str, Signal]
) -> Iterator[tuple[FaultUse, Variant, str]]:
    """Every variant of the faults of a module type with its local id."""
    uses = [(use, knowledge.fault_in(use)) for use in declared]
    shared = [fault.name for _, fault in uses if fault.acts_on != "signal"]
    for use, fault in uses:
        stem = use.target if fault.acts_on == "signal" else fault.name
        if fault.acts_on != "signal" and shared.count(fault.name) > 1:
            stem = f"{fault.name}.{use.target}"
        if fault.acts_on == "signal" and [u.target for u, _ in uses].count(use.target) > 1:
            stem = f"{use.target}.{fault.name}"
        for variant in fault.variants:
            own = for_signal(variant, signals.get(use.target), knowledge.units)
            yield use, own, f"{stem}.{variant.name}" if variant.name else stem


def _affected(
    kind: ModuleType,
    fault: FaultType,
    target: str,
    symbols: Mapping[str, sympy.Symbol],
    observers: Mapping[str, sympy.Expr],
) -> tuple[str, ...]:
    """Own observers that read what the fault acts on."""
    if fault.acts_on == "flow":
        return tuple(kind.components()[target])
    own, over = opened(kind, target, symbols, observers)
    return tuple(o for o, e in over.items() if own in e.free_symbols)


def law_of(variant: Variant, g: sympy.Expr, x: sympy.Expr) -> sympy.Expr:
    """The law of a fault with its g and x replaced."""
    return to_sympy(variant.law, {"g": g, "x": x})


def _rule(fault: FaultType, variant: Variant) -> DegreeRule:
    """Solve the law of a fault for its degree.

    A flow fault takes away after the observer, so the observer's flow is what should be there;
    any other fault distorts what the observer reads.
    """
    g, D, x = G, EXCESS, _symbol("x")
    onset = sympy.diff(law_of(variant, g, x), x).subs(x, 0)
    if fault.acts_on == "flow":
        solved, onset = invert(law_of(variant, g, x), x, g - D), -onset
    else:
        solved = invert(law_of(variant, g - D, x), x, g)
    assert solved is not None, "checked when the fault was read"
    degree = sympy.cancel(solved)
    by_excess = sympy.cancel(sympy.diff(degree, D))
    ratio = sympy.cancel(sympy.diff(degree, g) / by_excess)
    return DegreeRule(degree, by_excess, ratio, onset, sympy.sstr(degree, order="rev-lex"))


def _undone(
    kind: ModuleType, faults: tuple[TypeFault, ...], symbols: Mapping[str, sympy.Symbol]
) -> Undone:
    """At degree 0 these are the observers; at the true degree they agree again."""
    signals: dict[str, sympy.Expr] = {s: symbols[s] for s in kind.signals}
    for fault in faults:
        if fault.fault.acts_on == "signal":
            signals[fault.target] = _undo(fault, signals[fault.target])
    base = {**symbols, **signals}
    replaced: dict[str, sympy.Expr] = {}
    for fault in faults:
        if fault.fault.acts_on == "definition":
            current = written_out(kind, base, replaced)[fault.target]
            replaced[fault.target] = _undo(fault, current)
    undone = _observers(kind, base, replaced)
    for fault in faults:
        if fault.fault.acts_on == "flow":
            x = degree_symbol(fault.id)
            for observer in fault.affects:
                undone[observer] = law_of(fault.variant, undone[observer], x)
    degrees = {f.id: degree_symbol(f.id) for f in faults}
    gathered = {name: symbols[GATHERED + name] for name in kind.gathers}
    return Undone(
        undone,
        signals,
        _slopes(undone, degrees),
        _slopes(signals, degrees),
        _slopes(undone, gathered),
    )


def degree_symbol(fault: str) -> sympy.Symbol:
    """Symbol of the degree of a fault of the module at hand."""
    return _symbol(f"x.{fault}")


def _slopes(
    expressions: Mapping[str, sympy.Expr], variables: Mapping[str, sympy.Symbol]
) -> dict[tuple[str, str], sympy.Expr]:
    return {
        (name, variable): sympy.diff(expression, symbol)
        for name, expression in expressions.items()
        for variable, symbol in variables.items()
        if symbol in expression.free_symbols
    }


def _undo(fault: TypeFault, there: sympy.Expr) -> sympy.Expr:
    """What should be there, from what is there and the degree."""
    g, x = _symbol("g"), degree_symbol(fault.id)
    value = _symbol("value")
    solved = invert(law_of(fault.variant, g, x), g, value)
    assert solved is not None, "checked when the fault was read"
    return solved.xreplace({value: there})
