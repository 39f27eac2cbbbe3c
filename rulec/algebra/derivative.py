"""Derivatives of expressions that share most of their parts: each part is differentiated once."""

from functools import lru_cache

import sympy

KEPT = 1 << 17
"""Most derivatives of parts that are kept. Origin: numerical."""


@lru_cache(maxsize=KEPT)
def derivative(expression: sympy.Expr, symbol: sympy.Symbol) -> sympy.Expr:
    """The derivative in the form that `sympy.diff` gives it.

    That one searches the whole expression for the symbol at each of its parts, and takes several
    times as long over the equations of a plant.
    """
    if expression == symbol:
        return sympy.S.One
    if symbol not in symbols_in(expression):
        return sympy.S.Zero
    parts = expression.args
    inner = [derivative(part, symbol) for part in parts]
    if expression.is_Add:
        return sympy.Add(*inner)
    if expression.is_Mul:
        changed = ((i, slope) for i, slope in enumerate(inner) if slope)
        return sympy.Add(*(sympy.Mul(*parts[:i], slope, *parts[i + 1 :]) for i, slope in changed))
    if expression.is_Pow:
        (base, power), (by_base, by_power) = parts, inner
        return expression * (by_power * sympy.log(base) + by_base * power / base)
    if isinstance(expression, sympy.Function):
        changed = ((i, slope) for i, slope in enumerate(inner) if slope)
        return sympy.Add(*(expression.fdiff(i + 1) * slope for i, slope in changed))
    return sympy.diff(expression, symbol)


@lru_cache(maxsize=KEPT)
def symbols_in(expression: sympy.Basic) -> frozenset[sympy.Basic]:
    """The symbols of an expression, as its `free_symbols`, looked up once."""
    if expression.is_Symbol:
        return frozenset((expression,))
    return frozenset().union(*map(symbols_in, expression.args))
