"""The dimension of an equation as written."""

import ast
import functools
from collections.abc import Mapping
from fractions import Fraction

from rulec.language.expression import GATHER, Expression, function_of, rejected_at
from rulec.language.functions import FUNCTIONS, Gives
from rulec.language.units import NONE, PROPERTIES, TEMPERATURE, UNKNOWN, Dimension, exponent_of


def dimension(
    expression: Expression,
    known: Mapping[str, Dimension],
    gathered: Mapping[str, Dimension],
) -> Dimension:
    """Dimension of an expression; raises `Rejected` where two dimensions do not fit.

    That of the number 0 is `UNKNOWN`: it fits every dimension.
    """

    def walk(node: ast.expr) -> Dimension:
        match node:
            case ast.Constant(value=value):
                return UNKNOWN if value == 0 else NONE
            case ast.Name(id=name):
                return known[name]
            case ast.UnaryOp(operand=operand):
                return walk(operand)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                power = exponent_of(right)
                assert power is not None
                return walk(left) ** power
            case ast.BinOp(left=left, op=ast.Mult(), right=right):
                return walk(left) * walk(right)
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                return walk(left) / walk(right)
            case ast.BinOp(left=left, right=right):
                return _same(walk(left), walk(right), node)
            case ast.Call():
                return call(node)
        raise AssertionError(ast.dump(node))

    def call(node: ast.Call) -> Dimension:
        name = function_of(node)
        if name == GATHER:
            argument = node.args[0]
            assert isinstance(argument, ast.Name)
            return gathered[argument.id]
        parts = [walk(argument) for argument in node.args]
        if name in PROPERTIES:
            own = NONE if isinstance(node.args[0], ast.Constant) else parts[0]
            if not own.fits(TEMPERATURE):
                message = f"{name}() takes a temperature, but this has {own}"
                raise rejected_at(node.args[0], "KB052", message, f"as in {name}(T)")
            return PROPERTIES[name]
        assert name is not None
        gives = FUNCTIONS[name].gives
        if gives is Gives.ROOT:
            return parts[0] ** Fraction(1, 2)
        if gives is Gives.SAME:
            return functools.reduce(lambda a, b: _same(a, b, node), parts)
        if gives is Gives.PLAIN:
            return NONE
        if not parts[0].fits(NONE):
            message = f"the argument of {name}() must be a plain number, but has {parts[0]}"
            raise rejected_at(node.args[0], "KB052", message, "divide by a reference")
        return NONE

    return walk(expression.tree)


def _same(left: Dimension, right: Dimension, node: ast.expr) -> Dimension:
    if left.fits(right):
        return right if left == UNKNOWN else left
    message = f"these do not add up: {left} and {right}"
    raise rejected_at(node, "KB051", message, "is a factor or a square root missing?")
