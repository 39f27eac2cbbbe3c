"""Checked equations to sympy."""

from __future__ import annotations

import ast
import functools
from collections.abc import Callable, Mapping
from typing import Any

import sympy

from rulec.language.expression import GATHER, Expression, function_of
from rulec.language.functions import FUNCTIONS, Absolute
from rulec.language.units import exponent_of

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

    def walk(node: ast.expr) -> sympy.Expr:
        match node:
            case ast.Constant(value=int(value)):
                return sympy.Integer(value)
            case ast.Constant(value=float(value)):
                return sympy.Float(value)
            case ast.Name(id=name):
                return symbols[name]
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -walk(operand)
            case ast.UnaryOp(operand=operand):
                return walk(operand)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                power = exponent_of(right)
                assert power is not None
                return walk(left) ** sympy.Rational(power.numerator, power.denominator)
            case ast.BinOp(left=left, op=op, right=right):
                a, b = walk(left), walk(right)
                match op:
                    case ast.Add():
                        return a + b
                    case ast.Sub():
                        return a - b
                    case ast.Mult():
                        return a * b
                return a / b
            case ast.Call(args=args):
                function = function_of(node)
                if function == GATHER:
                    assert gathered is not None
                    assert isinstance(args[0], ast.Name)
                    return gathered[args[0].id]
                assert function is not None
                parts = [walk(a) for a in args]
                if function in FUNCTIONS:
                    return FUNCTIONS[function].symbolic(*parts)
                assert properties is not None
                return properties[function](*parts)
        raise AssertionError(ast.dump(node))

    # sympy turns the root of a square into its own Abs, whose derivatives no plan can hold.
    result = walk(expression.tree)
    return result.replace(sympy.Abs, Absolute) if result.has(sympy.Abs) else result
