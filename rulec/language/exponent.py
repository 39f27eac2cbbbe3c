"""Fixed exponents, in equations and in units."""

from __future__ import annotations

import ast
from fractions import Fraction

from rulec.limits import MAX_CONSTANT, MAX_DENOMINATOR


def exponent_of(node: ast.expr) -> Fraction | None:
    """Value of a numeric exponent: 2, -1, 0.5, 1/2, (7/4).

    >>> exponent_of(ast.parse("-1/3", mode="eval").body)
    Fraction(-1, 3)
    """
    match node:
        case ast.Constant(value=bool()):
            return None
        case ast.Constant(value=int(value) | float(value)) if abs(value) <= MAX_CONSTANT:
            return Fraction(value).limit_denominator(MAX_DENOMINATOR)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = exponent_of(operand)
            return None if inner is None else -inner
        case ast.BinOp(op=ast.Div(), left=left, right=right):
            top, bottom = exponent_of(left), exponent_of(right)
            return None if top is None or not bottom else top / bottom
    return None
