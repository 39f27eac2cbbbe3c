"""Refuse equations that become too long or too deep when definitions are written out.

Ten definitions that each use the previous one twice are short to write, but expand to thousands of
terms. The rules of differentiation are applied here to counts of terms only, so that an equation
that would become too long is refused before anything is built.
"""

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from rulec.knowledge.limits import MAX_COUNTED_TERMS, MAX_LAW_WORK, MAX_WORK, MAX_WRITTEN_DEPTH
from rulec.language.expression import Expression
from rulec.language.read_yaml import Path_
from rulec.language.reader import Reader


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


def check_lengths(
    reader: Reader,
    definitions: Iterable[tuple[Path_, Expression]],
    equations: Iterable[tuple[Path_, Expression]],
) -> None:
    """Report definitions (in order of use) or equations over them that grow too long.

    The last but one key of its path is the name of a definition.
    """
    known: dict[str, Length] = {}
    for path, expression in definitions:
        known[str(path[-2])] = length = _length_of(expression.tree, known)
        if _is_refused(reader, path, length, MAX_WORK):
            return
    total = 0
    for path, expression in equations:
        length = _length_of(expression.tree, known)
        if _is_refused(reader, path, length, MAX_WORK - total):
            return
        total += length.work


def check_law(reader: Reader, path: Path_, law: Expression) -> bool:
    """Whether the law of a fault is short enough; otherwise a mistake is reported."""
    return not _is_refused(reader, path, _length_of(law.tree, {}), MAX_LAW_WORK)


def _is_refused(reader: Reader, path: Path_, length: Length, most: int) -> bool:
    if length.depth > MAX_WRITTEN_DEPTH:
        message = f"with its definitions written out this is nested {length.depth} deep"
        hint = f"{MAX_WRITTEN_DEPTH} at most: let fewer definitions stand on one another"
    elif length.work > most:
        message = "with all definitions written out, this and its derivatives become too long"
        hint = "use a long definition once, not several times; leave out what matters little"
    else:
        return False
    reader.report(path, "KB042", message, hint)
    return True


def _length_of(node: ast.expr, known: Mapping[str, Length]) -> Length:
    """Length of an equation, given those of the definitions it uses; other names count as 1."""
    match node:
        case ast.Name(id=name):
            return known.get(name, Length(1, 1, 0, 0))
        case ast.UnaryOp(operand=operand):
            return _length_of(operand, known)
        case ast.BinOp(op=ast.Add() | ast.Sub(), left=left, right=right):
            return _sum(_length_of(left, known), _length_of(right, known))
        case ast.BinOp(op=ast.Mult(), left=left, right=right):
            return _product(_length_of(left, known), _length_of(right, known))
        case ast.BinOp(op=ast.Div(), left=left, right=right):
            return _product(_length_of(left, known), _applied(_length_of(right, known)))
        case ast.BinOp(op=ast.Pow(), left=left):
            return _applied(_length_of(left, known))
        case ast.Call(args=[only]):
            return _applied(_length_of(only, known))
        case ast.Call(args=[first, second]):
            return _chosen(_length_of(first, known), _length_of(second, known))
    return Length(1, 0, 0, 0)


def _capped(plain: int, slope: int, bend: int, depth: int) -> Length:
    plain, slope, bend = (min(count, MAX_COUNTED_TERMS) for count in (plain, slope, bend))
    return Length(plain, slope, bend, depth)


def _sum(a: Length, b: Length) -> Length:
    """(a + b)' = a' + b'"""
    depth = max(a.depth, b.depth) + 1
    return _capped(a.plain + b.plain, a.slope + b.slope, a.bend + b.bend, depth)


def _product(a: Length, b: Length) -> Length:
    """(ab)' = a'b + ab', (ab)'' = a''b + 2a'b' + ab''; constants have no derivative."""
    slope = _times(a.slope, b.plain) + _times(a.plain, b.slope)
    bend = _times(a.bend, b.plain) + _times(a.slope, b.slope) + _times(a.plain, b.bend)
    return _capped(a.plain + b.plain, slope, bend, max(a.depth, b.depth) + 1)


def _applied(u: Length) -> Length:
    """f(u)' = f'(u) u', f(u)'' = f''(u) u'^2 + f'(u) u''"""
    slope = _times(u.plain, u.slope)
    bend = slope + _times(u.plain, u.bend)
    return _capped(u.plain + 1, slope, bend, u.depth + 1)


def _chosen(a: Length, b: Length) -> Length:
    """max(a, b)' = s(a - b) a' + s(b - a) b'; that s' is 0 shows only once it has been built."""
    both = a.plain + b.plain
    slope = _times(both, a.slope) + _times(both, b.slope)
    bend = slope + _times(both, a.bend) + _times(both, b.bend)
    return _capped(both + 1, slope, bend, max(a.depth, b.depth) + 1)


def _times(a: int, b: int) -> int:
    """Terms of a product; none if a factor is zero."""
    return a + b if a and b else 0
