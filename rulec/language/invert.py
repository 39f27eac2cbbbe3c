"""Solve an equation for a symbol that occurs once, by undoing one operation after the other.

This is faster and more predictable than a general solver. It takes the principal branch, because
quantities are positive.
"""

from __future__ import annotations

import sympy

from rulec.language.functions import FUNCTIONS

_INVERSES = {f.symbolic: f.inverse for f in FUNCTIONS.values() if f.inverse is not None}


def invert(expression: sympy.Expr, symbol: sympy.Symbol, value: sympy.Expr) -> sympy.Expr | None:
    """Solve ``expression == value`` for `symbol`; None if it occurs twice or cannot be isolated.

    >>> g, k, q = sympy.symbols("g k q")
    >>> invert(sympy.sqrt(g / k), g, q)
    k*q**2
    """
    while expression != symbol:
        holding = [a for a in expression.args if a.has(symbol)]
        if len(holding) != 1:
            return None
        inner = holding[0]
        rest = [a for a in expression.args if a is not inner]
        if isinstance(expression, sympy.Add):
            value = value - sympy.Add(*rest)
        elif isinstance(expression, sympy.Mul):
            value = value / sympy.Mul(*rest)
        elif isinstance(expression, sympy.Pow) and expression.exp.is_Number:
            value = value ** (1 / expression.exp)
        elif expression.func in _INVERSES:
            value = _INVERSES[expression.func](value)
        else:
            return None
        expression = inner
    return value
