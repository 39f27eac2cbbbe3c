"""Effects of a change of the liquid on a module type: on equations that use the property, and on
laws that do not use it, which are identified by their form, never by name."""

import math
from collections.abc import Callable, Container, Iterator, Mapping
from functools import partial

import sympy

from rulec.algebra.derivative import derivative
from rulec.knowledge.check_dimensions import dimensions_of
from rulec.knowledge.effect import PLAIN
from rulec.knowledge.fluid import factor_name
from rulec.knowledge.liquid import BY, RATIO, Liquid, Move
from rulec.knowledge.module_type import Definition, ModuleType, Observer
from rulec.language.symbolic import ClosedForm, to_sympy
from rulec.language.units import VOLUME_FLOW

Symbols = Mapping[str, sympy.Symbol]
ByTarget = Callable[[str], tuple[sympy.Symbol, Mapping[str, sympy.Expr]]]
"""The symbol of a definition, and the observers as functions of it."""

Place = tuple[str, str]
"""A place of a module type, (kind, name)."""

STEEP = 0.5
"""Relative change of a law over that of its reading, above which the law is steep."""

TRIED = sympy.Float(1e-4)
"""Flow, m3/s, at which the slope of an estimate by a part of it is taken; its size does not matter,
as the part is a factor or a summand."""


def liquid_id(liquid: Liquid, variant: str) -> str:
    """Id of a fault of the liquid, such as ``liquid.density.high``."""
    return ".".join(part for part in ("liquid", liquid.property, variant) if part)


def moved_by(
    liquid: Liquid,
    kind: ModuleType,
    symbols: Symbols,
    values: Mapping[Place, sympy.Expr],
    over: ByTarget,
    ratio: sympy.Expr,
) -> Iterator[tuple[Place, Callable[[sympy.Expr], sympy.Expr]]]:
    """Places of a module type that a change of the liquid moves, in order of use.

    With each comes the function from its plain value to that where the property is `ratio` times
    the one of its law. A place of the kind ``parameter`` is the factor of a property that equations
    use. `values` holds definitions and observers over the local `symbols`.
    """
    factor = factor_name(kind.fluid, liquid.property) if kind.fluid else ""
    if factor in symbols:
        yield ("parameter", factor), lambda plain: plain * ratio
    for move in liquid.moves:
        found = list(_fitting(move, kind, symbols, over))
        inner = {part.name for part in found if isinstance(part, Definition)}
        for part in found:
            uses = kind.names_through(part.expression)
            place = ("observer" if isinstance(part, Observer) else "definition", part.name)
            value = values[place]
            has_factor = factor in symbols and symbols[factor] in value.free_symbols
            by = "" if uses & inner or has_factor else _by(move, kind, symbols, value, uses)
            if by:
                yield place, partial(_law, move, symbols[by], ratio)


def _law(move: Move, by: sympy.Symbol, ratio: sympy.Expr, plain: sympy.Expr) -> sympy.Expr:
    """Value of a place that falls or rises with the reading `by` as the move states."""
    law, table = move.law, {PLAIN: plain, RATIO: ratio}
    for name, replaced in law.substitutes.items():
        table[name] = plain.xreplace({by: to_sympy(replaced[BY], {RATIO: ratio})})
    return to_sympy(law.expression, table)


def _fitting(
    move: Move, kind: ModuleType, symbols: Symbols, over: ByTarget
) -> Iterator[Definition | Observer]:
    """Definitions and observers that give the quantity of a move, but read no signal of it.

    Those that give a flow must be an estimate of it.
    """
    dimensions = dimensions_of(kind)
    for definition in kind.definitions.values():
        fits = dimensions[definition.name] == move.gives and _is_unmeasured(move, kind, definition)
        if fits and _is_estimate(move, kind, symbols, over, definition.name):
            yield definition
    for observer in kind.observers.values():
        flow = move.gives == VOLUME_FLOW and not observer.is_reference
        if flow and _is_unmeasured(move, kind, observer):
            yield observer


def _is_unmeasured(move: Move, kind: ModuleType, part: Definition | Observer) -> bool:
    """Whether it reads signals, but none of the dimension that it gives."""
    names = kind.names_through(part.expression)
    read = [s for n, s in kind.signals.items() if n in names]
    return bool(read) and all(s.unit.dimension != move.gives for s in read)


def _is_estimate(move: Move, kind: ModuleType, symbols: Symbols, over: ByTarget, name: str) -> bool:
    """Whether estimates use it and, if it is a flow, none falls with it, as with a slip."""
    own, observers = over(name)
    using = [e for e in observers.values() if own in e.free_symbols]
    if move.gives != VOLUME_FLOW:
        return bool(using)
    slopes = (_number(derivative(e, own).xreplace({own: TRIED}), kind, symbols) for e in using)
    return bool(using) and all(slope >= 0.0 for slope in slopes)


def _by(
    move: Move, kind: ModuleType, symbols: Symbols, value: sympy.Expr, read: Container[str]
) -> str:
    """The own signal with which a place falls or rises as the move states; empty if none."""
    for signal in kind.signals.values():
        if signal.quantity != move.quantity or signal.name not in read:
            continue
        slope = _number(derivative(value, symbols[signal.name]), kind, symbols)
        if not move.sign * slope > 0.0:
            continue
        size, reading = _number(value, kind, symbols), _number(symbols[signal.name], kind, symbols)
        share = abs(slope * reading / size) if size else math.nan
        if move.steep is None or move.steep == (share > STEEP):
            return signal.name
    return ""


def _number(value: sympy.Expr, kind: ModuleType, symbols: Symbols) -> float:
    """A value at the typical readings of the type, without losses downstream; NaN if undefined."""
    table: dict[sympy.Symbol, sympy.Expr] = dict.fromkeys(symbols.values(), sympy.S.Zero)
    for name, signal in kind.signals.items():
        reading = signal.reference
        if reading is None:
            reading = 1.0 if signal.highest is None else 0.5 * signal.highest
        table[symbols[name]] = sympy.Float(reading)
    for name, parameter in kind.parameters.items():
        table[symbols[name]] = sympy.Float(parameter.value)
    plain = value.replace(lambda e: isinstance(e, ClosedForm), lambda e: e.written_out())
    found = sympy.N(plain.xreplace(table))
    return float(found) if found.is_real else math.nan
