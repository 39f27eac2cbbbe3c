"""The dimension of an equation as written."""

import ast
import functools
from collections.abc import Mapping
from fractions import Fraction

from rulec.language.expression import GATHER, Expression, function_of, rejected_at
from rulec.language.functions import FUNCTIONS, Gives
from rulec.language.units import NONE, PROPERTIES, TEMPERATURE, Dimension, exponent_of


def dimension(
    expression: Expression,
    known: Mapping[str, Dimension],
    gathered: Mapping[str, Dimension],
) -> Dimension:
    """Dimension of an expression; raises `Rejected` where two dimensions do not fit."""
    zero = _Zero()

    def walk(node: ast.expr) -> Dimension | _Zero:
        match node:
            case ast.Constant(value=value):
                return zero if value == 0 else NONE
            case ast.Name(id=name):
                return known[name]
            case ast.UnaryOp(operand=operand):
                return walk(operand)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                base, power = walk(left), exponent_of(right)
                assert power is not None
                return zero if base is zero else _solid(base) ** power
            case ast.BinOp(left=left, op=op, right=right):
                return _binary(op, walk(left), walk(right), node)
            case ast.Call():
                return call(node)
        raise AssertionError(ast.dump(node))

    def call(node: ast.Call) -> Dimension | _Zero:
        name = function_of(node)
        if name == GATHER:
            argument = node.args[0]
            assert isinstance(argument, ast.Name)
            return gathered[argument.id]
        parts = [walk(argument) for argument in node.args]
        if name in PROPERTIES:
            if not _solid(parts[0]).fits(TEMPERATURE):
                message = f"{name}() takes a temperature, but this has {_solid(parts[0])}"
                raise rejected_at(node.args[0], "KB052", message, f"as in {name}(T)")
            return PROPERTIES[name]
        assert name is not None
        gives = FUNCTIONS[name].gives
        if gives is Gives.ROOT:
            return zero if parts[0] is zero else _solid(parts[0]) ** Fraction(1, 2)
        if gives is Gives.SAME:
            return functools.reduce(lambda a, b: _same(a, b, node), parts)
        if gives is Gives.PLAIN:
            return NONE
        if not _solid(parts[0]).fits(NONE):
            message = f"the argument of {name}() must be a plain number, but has {parts[0]}"
            raise rejected_at(node.args[0], "KB052", message, "divide by a reference")
        return NONE

    result = walk(expression.tree)
    return NONE if result is zero else _solid(result)


class _Zero:
    """The number 0 fits any dimension."""


def _solid(value: Dimension | _Zero) -> Dimension:
    return value if isinstance(value, Dimension) else NONE


def _same(left: Dimension | _Zero, right: Dimension | _Zero, node: ast.expr) -> Dimension | _Zero:
    if isinstance(left, _Zero):
        return right
    if isinstance(right, _Zero) or left.fits(right):
        return left
    message = f"these do not add up: {left} and {right}"
    raise rejected_at(node, "KB051", message, "is a factor or a square root missing?")


def _binary(
    op: ast.operator, left: Dimension | _Zero, right: Dimension | _Zero, node: ast.expr
) -> Dimension | _Zero:
    if isinstance(op, ast.Add | ast.Sub):
        return _same(left, right, node)
    if isinstance(left, _Zero):
        return left
    if isinstance(right, _Zero):
        return right
    return left * right if isinstance(op, ast.Mult) else left / right
