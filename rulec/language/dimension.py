"""The dimension of an equation as written."""

import ast
import functools
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from rulec.language.expression import ARITHMETIC, Expression, fold, rejected_at
from rulec.language.functions import FUNCTIONS
from rulec.language.units import NONE, PROPERTIES, TEMPERATURE, UNKNOWN, Dimension


def dimension(
    expression: Expression,
    dimensions: Mapping[str, Dimension],
    gathered: Mapping[str, Dimension],
) -> Dimension:
    """Dimension of an expression; raises `Rejected` where two dimensions do not fit.

    That of the number 0 is `UNKNOWN`: it fits every dimension.
    """

    def leaf(node: ast.expr) -> Dimension:
        match node:
            case ast.Constant(value=value):
                return UNKNOWN if value == 0 else NONE
            case ast.Name(id=name):
                return dimensions[name]
            case ast.Call(args=[ast.Name(id=name)]):
                return gathered[name]
        raise AssertionError(ast.dump(node))

    return fold(expression.tree, leaf, _of_operation)


def _of_operation(name: str, node: Any, parts: list[Dimension]) -> Dimension:
    if name in PROPERTIES:
        own = NONE if isinstance(node.args[0], ast.Constant) else parts[0]
        if not own.fits(TEMPERATURE):
            message = f"{name}() takes a temperature, but this has {own}"
            raise rejected_at(node.args[0], "KB052", message, f"as in {name}(T)")
        return PROPERTIES[name]
    gives = FUNCTIONS[name].gives if name in FUNCTIONS else None
    if name in ("add", "sub", "neg") or gives == "same":
        return functools.reduce(lambda a, b: _same(a, b, node), parts)
    if gives == "plain of plain" and not parts[0].fits(NONE):
        message = f"the argument of {name}() must be a plain number, but has {parts[0]}"
        raise rejected_at(node.args[0], "KB052", message, "divide by a reference")
    if gives is None:
        product: Dimension = ARITHMETIC[name](*parts)
        return product
    root: Dimension = parts[0] ** Fraction(1, 2)
    return root if gives == "root" else NONE


def _same(left: Dimension, right: Dimension, node: ast.expr) -> Dimension:
    if left.fits(right):
        return right if left == UNKNOWN else left
    message = f"these do not add up: {left} and {right}"
    raise rejected_at(node, "KB051", message, "is a factor or a square root missing?")
