"""What a change of the liquid moves in a module type: equations that ask for its property, and laws
that do not, found by what they are and never by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import sympy

from rulec.knowledge.effect import PLAIN
from rulec.knowledge.fluid import factor_name
from rulec.knowledge.liquid import BY, RATIO, Liquid, Move
from rulec.knowledge.module_type import Definition, ModuleType, Observer
from rulec.language.dimension import dimension
from rulec.language.symbolic import ClosedForm, to_sympy
from rulec.language.units import UNKNOWN, VOLUME_FLOW

Symbols = Mapping[str, sympy.Symbol]
Opened = Callable[[str], tuple[sympy.Symbol, Mapping[str, sympy.Expr]]]
"""The symbol of a definition, and the observers over it."""

STEEP = 0.5
"""Share by which what is given changes over that of the reading, from which on a law is steep."""


TRIED = sympy.Float(1e-4)
"""Flow, m3/s, at which the slope of an estimate by a part of it is taken: it stands there as a
factor or a summand, so that the size does not matter."""


def liquid_id(liquid: Liquid, variant: str) -> str:
    """Id of a fault of the liquid, such as ``liquid.density.high``."""
    return ".".join(part for part in ("liquid", liquid.property, variant) if part)


@dataclass(frozen=True)
class Moved:
    """A place, (kind, name), with the `move` of its law by readings of the signal `by`; of the kind
    ``parameter``, the factor of a property that equations ask for, without one."""

    place: tuple[str, str]
    move: Move | None
    by: str

    def law(self, plain: sympy.Expr, symbols: Symbols, ratio: sympy.Expr) -> sympy.Expr:
        """What the place should give, where the property is `ratio` times that of its law."""
        if self.move is None:
            return plain * ratio
        law, table = self.move.law, {PLAIN: plain, RATIO: ratio}
        for name, replaced in law.substitutes.items():
            value = to_sympy(replaced[BY], {RATIO: ratio})
            table[name] = plain.xreplace({symbols[self.by]: value})
        return to_sympy(law.expression, table)


def moved_by(
    liquid: Liquid,
    kind: ModuleType,
    symbols: Symbols,
    values: Mapping[tuple[str, str], sympy.Expr],
    opened: Opened,
) -> Iterator[Moved]:
    """Places of a module type that a change of the liquid moves, in order of use.

    `values` are definitions and observers, by (kind, name), over the local `symbols`.
    """
    asks = factor_name(kind.fluid, liquid.property) if kind.fluid else ""
    if asks in symbols:
        yield Moved(("parameter", asks), None, "")
    for move in liquid.moves:
        found = list(_fitting(move, kind, symbols, opened))
        inner = {part.name for part in found if isinstance(part, Definition)}
        for part in found:
            uses = kind.names_through(part.expression) - (
                {part.name} if isinstance(part, Definition) else set()
            )
            place = ("observer" if isinstance(part, Observer) else "definition", part.name)
            value = values[place]
            known = asks in symbols and symbols[asks] in value.free_symbols
            by = "" if uses & inner or known else _by(move, kind, symbols, value, uses)
            if by:
                yield Moved(place, move, by)


def _fitting(
    move: Move, kind: ModuleType, symbols: Symbols, opened: Opened
) -> Iterator[Definition | Observer]:
    """Definitions and observers that give the quantity, read nothing of that kind, and are an
    estimate of the flow where they give one."""
    known = {n: s.unit.dimension for n, s in kind.signals.items()}
    known |= {n: p.unit.dimension for n, p in kind.parameters.items()}
    own = dict(known)
    for definition in kind.definitions.values():
        gathered = dict.fromkeys(kind.gathers, UNKNOWN)
        own[definition.name] = dimension(definition.expression, own, gathered)
        fits = own[definition.name] == move.gives and _is_unmeasured(move, kind, definition)
        if fits and _is_estimate(move, kind, symbols, opened, definition.name):
            yield definition
    for observer in kind.observers.values():
        flow = move.gives == VOLUME_FLOW and not observer.is_reference
        if flow and _is_unmeasured(move, kind, observer):
            yield observer


def _is_unmeasured(move: Move, kind: ModuleType, part: Definition | Observer) -> bool:
    """Does it read no signal of the very kind it gives?"""
    names = kind.names_through(part.expression)
    read = [s for n, s in kind.signals.items() if n in names]
    return bool(read) and all(s.unit.dimension != move.gives for s in read)


def _is_estimate(move: Move, kind: ModuleType, symbols: Symbols, opened: Opened, name: str) -> bool:
    """Does no estimate fall with it, if it is a flow? A slip is subtracted, and is none."""
    own, observers = opened(name)
    over = [e for e in observers.values() if own in e.free_symbols]
    if move.gives != VOLUME_FLOW:
        return bool(over)
    slopes = (_number(sympy.diff(e, own).xreplace({own: TRIED}), kind, symbols) for e in over)
    return bool(over) and all(slope >= 0.0 for slope in slopes)


def _by(
    move: Move,
    kind: ModuleType,
    symbols: Symbols,
    value: sympy.Expr,
    names: Iterable[str],
) -> str:
    """The own signal with which a place falls or rises as a move asks; empty if none."""
    read = set(names)
    for signal in kind.signals.values():
        if signal.quantity != move.quantity or signal.name not in read:
            continue
        slope = _number(sympy.diff(value, symbols[signal.name]), kind, symbols)
        if not move.sign * slope > 0.0:
            continue
        size, reading = _number(value, kind, symbols), _number(symbols[signal.name], kind, symbols)
        share = abs(slope * reading / size) if size else math.nan
        if move.steep is None or move.steep == (share > STEEP):
            return signal.name
    return ""


def _number(value: sympy.Expr, kind: ModuleType, symbols: Symbols) -> float:
    """A value at the typical readings of the type, nothing lost downstream; NaN where none."""
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
