"""Checked equations to sympy, and equations solved for a symbol."""

import ast
import functools
from collections.abc import Callable, Mapping
from typing import Any

import sympy

from rulec.language.expression import ARITHMETIC, Expression, fold
from rulec.language.functions import FUNCTIONS, Absolute

TEMPERATURE = sympy.Symbol("T", real=True)
"""The variable of a fluid's equations, K."""


class ClosedForm(sympy.Function):  # type: ignore[misc]
    """A function of temperature that stays one symbol until its value is needed.

    Written out at once, it would make derivatives long and equations unreadable.
    """

    nargs = 1
    form: sympy.Expr

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        derivative = closed_form(f"{self.func.__name__}'", sympy.diff(self.form, TEMPERATURE))
        return derivative(self.args[0])

    def written_out(self) -> sympy.Expr:
        """The form, at the temperature given by the argument."""
        return self.form.xreplace({TEMPERATURE: self.args[0]})


@functools.lru_cache(maxsize=1000)
def closed_form(name: str, form: sympy.Expr) -> type[ClosedForm]:
    """An expression as a function of `TEMPERATURE`; equal calls give the same function.

    >>> closed_form("density", 1000 - 2 * TEMPERATURE)(sympy.Symbol("t")).diff()
    density'(t)
    """
    metaclass: Any = type(ClosedForm)
    kind: type[ClosedForm] = metaclass(name, (ClosedForm,), {"form": form})
    return kind


def to_sympy(
    expression: Expression,
    symbols: Mapping[str, sympy.Expr],
    gathered: Mapping[str, sympy.Expr] | None = None,
    properties: Mapping[str, Callable[[sympy.Expr], sympy.Expr]] | None = None,
) -> sympy.Expr:
    """Translate to sympy, with each name from the given tables (a KeyError is a bug of ours)."""

    def leaf(node: ast.expr) -> sympy.Expr:
        match node:
            case ast.Constant(value=int(value)):
                return sympy.Integer(value)
            case ast.Constant(value=value):
                return sympy.Float(value)
            case ast.Name(id=name):
                return symbols[name]
            case ast.Call(args=[ast.Name(id=name)]) if gathered is not None:
                return gathered[name]
        raise AssertionError(ast.dump(node))

    def operation(name: str, _: ast.expr, parts: list[Any]) -> sympy.Expr:
        if name == "pow":
            parts[1] = sympy.Rational(parts[1].numerator, parts[1].denominator)
        if name in ARITHMETIC:
            return ARITHMETIC[name](*parts)
        if name in FUNCTIONS:
            return FUNCTIONS[name].symbolic(*parts)
        assert properties is not None
        return properties[name](*parts)

    # sympy turns the root of a square into its own Abs, whose derivatives no plan can hold.
    result = fold(expression.tree, leaf, operation)
    return result.replace(sympy.Abs, Absolute) if result.has(sympy.Abs) else result


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
