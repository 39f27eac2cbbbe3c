"""The length that an equation and its derivatives would have with all definitions written out.

Ten definitions that each use the previous one twice are short to write, but expand to thousands of
terms. The rules of differentiation are applied here to counts of terms only, so that an equation
that would become too long is refused before anything is built.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass

from rulec.language.expression import Expression
from rulec.limits import MAX_COUNTED_TERMS


@dataclass(frozen=True)
class Length:
    """Counts of terms: of an equation written out, and of its two derivatives by a name.

    `depth` is the nesting depth of its operations.
    """

    plain: int
    slope: int
    bend: int
    depth: int

    @property
    def work(self) -> int:
        """Effort of differentiating twice: slopes by every name are built, bends by few names.

        Fitted by eye to the time for chains of nine kinds of equation.
        """
        return 5 * self.slope + self.bend


NUMBER = Length(1, 0, 0, 0)
NAME = Length(1, 1, 0, 0)


def length_of(expression: Expression, known: Mapping[str, Length]) -> Length:
    """Length of an equation, given those of the definitions it uses; other names count as 1."""
    return _walk(expression.tree, known)


def _walk(node: ast.expr, known: Mapping[str, Length]) -> Length:
    match node:
        case ast.Name(id=name):
            return known.get(name, NAME)
        case ast.UnaryOp(operand=operand):
            return _walk(operand, known)
        case ast.BinOp(op=ast.Add() | ast.Sub(), left=left, right=right):
            return _sum(_walk(left, known), _walk(right, known))
        case ast.BinOp(op=ast.Mult(), left=left, right=right):
            return _product(_walk(left, known), _walk(right, known))
        case ast.BinOp(op=ast.Div(), left=left, right=right):
            return _product(_walk(left, known), _applied(_walk(right, known)))
        case ast.BinOp(op=ast.Pow(), left=left):
            return _applied(_walk(left, known))
        case ast.Call(args=[only]):
            return _applied(_walk(only, known))
        case ast.Call(args=[first, second]):
            return _chosen(_walk(first, known), _walk(second, known))
    return NUMBER


def _length(plain: int, slope: int, bend: int, depth: int) -> Length:
    plain, slope, bend = (min(count, MAX_COUNTED_TERMS) for count in (plain, slope, bend))
    return Length(plain, slope, bend, depth)


def _sum(a: Length, b: Length) -> Length:
    """(a + b)' = a' + b'"""
    depth = max(a.depth, b.depth) + 1
    return _length(a.plain + b.plain, a.slope + b.slope, a.bend + b.bend, depth)


def _product(a: Length, b: Length) -> Length:
    """(ab)' = a'b + ab', (ab)'' = a''b + 2a'b' + ab''; constants have no derivative."""
    slope = _times(a.slope, b.plain) + _times(a.plain, b.slope)
    bend = _times(a.bend, b.plain) + _times(a.slope, b.slope) + _times(a.plain, b.bend)
    return _length(a.plain + b.plain, slope, bend, max(a.depth, b.depth) + 1)


def _applied(u: Length) -> Length:
    """f(u)' = f'(u) u', f(u)'' = f''(u) u'^2 + f'(u) u''"""
    slope = _times(u.plain, u.slope)
    bend = _times(u.plain, u.slope) + _times(u.plain, u.bend)
    return _length(u.plain + 1, slope, bend, u.depth + 1)


def _chosen(a: Length, b: Length) -> Length:
    """max(a, b)' = s(a - b) a' + s(b - a) b'; that s' is 0 shows only once it has been built."""
    both = a.plain + b.plain
    slope = _times(both, a.slope) + _times(both, b.slope)
    bend = slope + _times(both, a.bend) + _times(both, b.bend)
    return _length(both + 1, slope, bend, max(a.depth, b.depth) + 1)


def _times(a: int, b: int) -> int:
    """Terms of a product; none if a factor is zero."""
    return a + b if a and b else 0
