"""Rewrite equations: replace names by trees, and write trees as text in the style of kb/."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping

from rulec.language.expression import GATHER, Expression, function_of, parse
from rulec.language.units import exponent_of


def text_of(tree: ast.expr) -> str:
    """A tree as text in the style of kb/: products without blanks.

    >>> text_of(ast.parse("a-b*c**2", mode="eval").body)
    'a - b*c**2'
    """
    return re.sub(r" (\*\*?|/) ", r"\1", ast.unparse(tree))


def written(tree: ast.expr) -> Expression:
    """A tree as an expression with its text; raises `Rejected` if it is not in the language."""
    return parse(text_of(tree))


def over(expression: Expression, table: Mapping[str, ast.expr]) -> Expression:
    """The expression with names replaced; the same object if it contains none of them."""
    if not any(name in table for name, _ in expression.names()):
        return expression
    return written(replaced(expression.tree, table))


def name_node(name: str) -> ast.Name:
    """The tree of a name, which need not be legal in an equation: ``B.T`` serves in shown text."""
    return ast.Name(id=name, ctx=ast.Load())


def replaced(node: ast.expr, table: Mapping[str, ast.expr]) -> ast.expr:
    """A tree with names replaced by trees; terms that a zero cancels are dropped.

    >>> ast.unparse(replaced(parse("a - b*p**2").tree, {"p": ast.Constant(0)}))
    'a'
    """
    match node:
        case ast.Name(id=name):
            return table.get(name, node)
        case ast.Call(func=function, args=arguments) if function_of(node) != GATHER:
            return ast.Call(function, [replaced(a, table) for a in arguments], [])
        case ast.UnaryOp(op=op, operand=operand):
            inner = replaced(operand, table)
            return inner if _is_zero(inner) else ast.UnaryOp(op, inner)
        case ast.BinOp(left=left, op=ast.Pow() as op, right=power):
            base = replaced(left, table)
            positive = (exponent_of(power) or 0) > 0
            return base if _is_zero(base) and positive else ast.BinOp(base, op, power)
        case ast.BinOp(left=left, op=op, right=right):
            return _without_zero(replaced(left, table), op, replaced(right, table))
    return node


def _without_zero(left: ast.expr, op: ast.operator, right: ast.expr) -> ast.expr:
    if isinstance(op, ast.Mult) and (_is_zero(left) or _is_zero(right)):
        return ast.Constant(0)
    if isinstance(op, ast.Div) and _is_zero(left) and not _is_zero(right):
        return left
    if isinstance(op, ast.Add) and _is_zero(left):
        return right
    if isinstance(op, ast.Add | ast.Sub) and _is_zero(right):
        return left
    return ast.BinOp(left, op, right)


def _is_zero(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and node.value == 0
