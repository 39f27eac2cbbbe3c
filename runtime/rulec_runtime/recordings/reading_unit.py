"""Units of readings, by the table of spellings of the ruleset."""

import ast
import re
from collections.abc import Mapping

import numpy as np

from rulec_runtime.contract.ruleset import SignalSpec, UnitSpec
from rulec_runtime.contract.unit_text import plain_text
from rulec_runtime.output.nearest import nearest
from rulec_runtime.recordings import limits

_NEGATIVE = re.compile(r"(?<=[A-Za-z])-(\d)")


def parse_unit(text: str, units: Mapping[str, UnitSpec]) -> UnitSpec | None:
    """Look up a unit; products, quotients and powers are combined. None if unknown.

    >>> bar, h = UnitSpec(1e5, 0, (-1, 1, -2, 0)), UnitSpec(3600, 0, (0, 0, 1, 0))
    >>> parse_unit("bar/h", {"bar": bar, "h": h})
    UnitSpec(factor=27.77777777777778, offset=0.0, dimension=(-1.0, 1.0, -3.0, 0.0))
    """
    text = plain_text(text)
    if text in units:
        return units[text]
    if len(text) > limits.LONGEST_UNIT:
        return None
    try:
        tree = ast.parse(_NEGATIVE.sub(r"**-\1", text), mode="eval").body
        factor, dimension = _walk(tree, units)
    except (SyntaxError, ValueError, RecursionError, MemoryError, ArithmeticError):
        return None
    return UnitSpec(factor, 0.0, tuple(float(d) for d in dimension))


def _walk(node: ast.expr, units: Mapping[str, UnitSpec]) -> tuple[float, np.ndarray]:
    """Factor and dimension of a tree; ValueError for anything but units and * / **."""
    match node:
        case ast.Constant(value=1):  # of no dimension
            return 1.0, np.zeros(max((len(u.dimension) for u in units.values()), default=0))
        case ast.Name(id=name) if name in units and not units[name].offset:
            return units[name].factor, np.array(units[name].dimension)
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as op, right=right):
            (f, d), (g, e) = _walk(left, units), _walk(right, units)
            return (f * g, d + e) if isinstance(op, ast.Mult) else (f / g, d - e)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            f, d = _walk(left, units)
            power = _power(right)
            return float(f**power), power * d
    raise ValueError("not a unit")


def _power(node: ast.expr) -> float:
    """Value of a fixed exponent: 2, -1, 0.5, (1/2)."""
    match node:
        case ast.Constant(value=int(value) | float(value)) if abs(value) <= limits.LARGEST_POWER:
            return value
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_power(operand)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return _power(left) / _power(right)
    raise ValueError("not a power")


def conversion(signal: SignalSpec, unit: str, units: Mapping[str, UnitSpec]) -> tuple[float, float]:
    """Factor and offset: SI = reading in `unit` * factor + offset; without a unit, that of the
    signal is used. Raises ValueError, with what to write instead."""
    if unit in ("", signal.unit):
        return signal.factor, signal.offset
    found, wanted = parse_unit(unit, units), parse_unit(signal.unit, units)
    if found is None:
        known = fitting(wanted, units) or [signal.unit]
        near = nearest(unit, known)
        hint = f"did you mean '{near}'? " if near else ""
        raise ValueError(
            f"unknown unit '{unit[:40]}'; {hint}for {signal.id} write {', '.join(known[:8])}"
        )
    if wanted is not None and found.dimension != wanted.dimension:
        raise ValueError(
            f"it is in {unit[:40]}, but {signal.id} is measured in {signal.unit}; are two swapped?"
        )
    return found.factor, found.offset


def fitting(wanted: UnitSpec | None, units: Mapping[str, UnitSpec]) -> list[str]:
    """Spellings of units of the same dimension."""
    if wanted is None:
        return []
    return [name for name, unit in units.items() if unit.dimension == wanted.dimension]
