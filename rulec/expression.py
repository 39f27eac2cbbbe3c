"""Equation text to a checked expression: an own whitelist over Python's `ast`.

Nothing is ever evaluated. Only numbers, declared names, + - * /, powers with a fixed exponent and
a short list of functions pass; everything else is refused with its column. `E`, `I`, `N`, `beta`
are ordinary names here, which is why sympy's own reader is not used.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

import sympy

from rulec.units import NONE, Dimension

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,40}")
MAX_LENGTH = 600
MAX_DEPTH = 30
MAX_POWER = 8
ARITY = {
    "sqrt": 1, "abs": 1, "sign": 1, "exp": 1, "log": 1, "tanh": 1, "min": 2, "max": 2,
}  # fmt: skip
GATHER = "downstream"


class Rejected(ValueError):
    """An expression that is not in the language: code, column (from 0), message, hint."""

    def __init__(self, code: str, column: int, message: str, hint: str = "", length: int = 1):
        super().__init__(message)
        self.code, self.column, self.message = code, column, message
        self.hint, self.length = hint, length


@dataclass(frozen=True)
class Expression:
    """A checked expression: its text, and its tree of Python `ast` nodes of the whitelist."""

    text: str
    tree: ast.expr

    def names(self) -> Iterator[tuple[str, int]]:
        """Names used outside calls of `downstream`, with their columns."""
        yield from _names(self.tree)

    def gathered(self) -> Iterator[tuple[str, int]]:
        """Names inside `downstream(...)`, with their columns."""
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Call) and _function(node) == GATHER:
                argument = node.args[0]
                assert isinstance(argument, ast.Name)
                yield argument.id, argument.col_offset

    def __str__(self) -> str:
        return self.text


def parse(text: str) -> Expression:
    """Read an expression; raises `Rejected` for anything outside the language.

    >>> parse("sqrt((dp - k0)/k2)").text
    'sqrt((dp - k0)/k2)'
    """
    if len(text) > MAX_LENGTH:
        message = f"the expression has {len(text)} characters; at most {MAX_LENGTH} are read"
        raise Rejected("KB042", 0, message, "split it with definitions")
    bad = next((i for i, c in enumerate(text) if not c.isascii() or c == "\0"), None)
    if bad is not None:
        raise Rejected("KB040", bad, f"the character {text[bad]!r} is not allowed here")
    if not text.strip():
        raise Rejected("KB040", 0, "the expression is empty")
    indent = len(text) - len(text.lstrip())
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except SyntaxError as error:
        column = min((error.offset or 1) - 1 + indent, len(text) - 1)
        raise Rejected("KB040", column, "this cannot be read as an expression") from None
    except (ValueError, RecursionError, MemoryError):
        raise Rejected("KB042", 0, "the expression is nested too deeply") from None
    ast.increment_lineno(tree, 0)
    for node in ast.walk(tree):
        if hasattr(node, "col_offset"):
            node.col_offset += indent
    _check(tree, 0)
    return Expression(text, tree)


def _check(node: ast.expr, depth: int) -> None:
    """Refuse every construct that is not on the list."""
    column = node.col_offset
    if depth > MAX_DEPTH:
        raise Rejected("KB042", column, f"nested deeper than {MAX_DEPTH}", "use definitions")
    match node:
        case ast.Constant(value=bool() | str() | bytes() | complex() | None):
            raise Rejected("KB041", column, "only numbers and names are allowed here")
        case ast.Constant(value=int(value) | float(value)):
            if not math.isfinite(value) or abs(value) > 1e30:
                raise Rejected("KB041", column, "this number is out of bounds")
        case ast.Name(id=name):
            if not NAME.fullmatch(name):
                raise Rejected("KB041", column, f"'{name}' is not a legal name", "", len(name))
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            _check(operand, depth + 1)
        case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div(), left=left, right=right):
            _check(left, depth + 1)
            _check(right, depth + 1)
        case ast.BinOp(op=ast.Pow(), left=left, right=right):
            _check(left, depth + 1)
            power = _exponent(right)
            if power is None or abs(power) > MAX_POWER:
                hint = f"a number of size {MAX_POWER} at most"
                raise Rejected("KB043", right.col_offset, "an exponent must be a number", hint)
        case ast.Call():
            _check_call(node, depth)
        case _:
            raise Rejected("KB041", column, f"{_kind(node)} is not allowed in an equation")


def _check_call(node: ast.Call, depth: int) -> None:
    column, name = node.col_offset, _function(node)
    if name is None or node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
        raise Rejected("KB041", column, "only plain function calls are allowed")
    if name == GATHER:
        if len(node.args) != 1 or not isinstance(node.args[0], ast.Name):
            raise Rejected("KB045", column, f"{GATHER}() takes one name", "downstream(dp_mix)")
        return
    if name not in ARITY:
        from rulec.diagnostics import did_you_mean

        hint = did_you_mean(name, [*ARITY, GATHER])
        raise Rejected("KB044", column, f"there is no function '{name}'", hint, len(name))
    if len(node.args) != ARITY[name]:
        message = f"{name}() takes {ARITY[name]} argument(s), not {len(node.args)}"
        raise Rejected("KB045", column, message, "", len(name))
    for argument in node.args:
        _check(argument, depth + 1)


def _exponent(node: ast.expr) -> Fraction | None:
    """Value of a numeric exponent: 2, -1, 0.5, 1/2, (7/4)."""
    match node:
        case ast.Constant(value=bool()):
            return None
        case ast.Constant(value=int(value) | float(value)) if math.isfinite(value):
            return Fraction(value).limit_denominator(1000)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = _exponent(operand)
            return None if inner is None else -inner
        case ast.BinOp(op=ast.Div(), left=left, right=right):
            top, bottom = _exponent(left), _exponent(right)
            return None if top is None or not bottom else top / bottom
    return None


def _function(node: ast.Call) -> str | None:
    return node.func.id if isinstance(node.func, ast.Name) else None


def _kind(node: ast.AST) -> str:
    words = {
        ast.Attribute: "a dot",
        ast.Subscript: "an index",
        ast.Lambda: "a function definition",
        ast.Compare: "a comparison",
        ast.BoolOp: "'and' or 'or'",
        ast.IfExp: "a condition",
        ast.List: "a list",
        ast.Tuple: "a comma",
        ast.JoinedStr: "a text",
    }
    return words.get(type(node), "this")


def _names(node: ast.expr) -> Iterator[tuple[str, int]]:
    match node:
        case ast.Name(id=name):
            yield name, node.col_offset
        case ast.Call():
            if _function(node) != GATHER:
                for argument in node.args:
                    yield from _names(argument)
        case ast.UnaryOp(operand=operand):
            yield from _names(operand)
        case ast.BinOp(left=left, right=right):
            yield from _names(left)
            if not isinstance(node.op, ast.Pow):
                yield from _names(right)


def dimension(
    expression: Expression,
    known: Mapping[str, Dimension],
    gathered: Mapping[str, Dimension],
) -> Dimension:
    """Dimension of an expression as written; raises `Rejected` where sides do not fit."""
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
                base, power = walk(left), _exponent(right)
                assert power is not None
                return zero if base is zero else _solid(base) ** power
            case ast.BinOp(left=left, op=op, right=right):
                return _binary(op, walk(left), walk(right), node)
            case ast.Call():
                return call(node)
        raise AssertionError(ast.dump(node))

    def call(node: ast.Call) -> Dimension | _Zero:
        name = _function(node)
        if name == GATHER:
            argument = node.args[0]
            assert isinstance(argument, ast.Name)
            return gathered[argument.id]
        parts = [walk(argument) for argument in node.args]
        if name == "sqrt":
            return zero if parts[0] is zero else _solid(parts[0]) ** Fraction(1, 2)
        if name == "abs":
            return parts[0]
        if name in ("min", "max"):
            return _same(parts[0], parts[1], node)
        if name == "sign":
            return NONE
        if parts[0] is not zero and parts[0] != NONE:
            message = f"the argument of {name}() must be a plain number, but has {parts[0]}"
            raise Rejected("KB052", node.args[0].col_offset, message, "divide by a reference")
        return NONE

    result = walk(expression.tree)
    return NONE if result is zero else _solid(result)


class _Zero:
    """The number 0 fits any dimension."""


def _solid(value: Dimension | _Zero) -> Dimension:
    return value if isinstance(value, Dimension) else NONE


def _same(left: Dimension | _Zero, right: Dimension | _Zero, node: ast.AST) -> Dimension | _Zero:
    if isinstance(left, _Zero):
        return right
    if isinstance(right, _Zero) or left == right:
        return left
    column = getattr(node, "op_column", getattr(node, "col_offset", 0))
    message = f"these do not add up: {left} and {right}"
    length = max(1, getattr(node, "end_col_offset", column + 1) - getattr(node, "col_offset", 0))
    raise Rejected("KB051", column, message, "a factor or a square root is missing", length)


def _binary(
    op: ast.operator, left: Dimension | _Zero, right: Dimension | _Zero, node: ast.AST
) -> Dimension | _Zero:
    if isinstance(op, ast.Add | ast.Sub):
        return _same(left, right, node)
    if isinstance(left, _Zero):
        return left
    if isinstance(right, _Zero):
        return right
    return left * right if isinstance(op, ast.Mult) else left / right


_FUNCTIONS: Mapping[str, Callable[..., sympy.Expr]] = {
    "sqrt": sympy.sqrt,
    "abs": sympy.Abs,
    "sign": sympy.sign,
    "exp": sympy.exp,
    "log": sympy.log,
    "tanh": sympy.tanh,
    "min": sympy.Min,
    "max": sympy.Max,
}


def to_sympy(
    expression: Expression,
    symbols: Mapping[str, sympy.Expr],
    gathered: Mapping[str, sympy.Expr] | None = None,
) -> sympy.Expr:
    """Translate to sympy, each name by the given table (a KeyError is our own bug)."""

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
                power = _exponent(right)
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
                name = _function(node)
                if name == GATHER:
                    assert gathered is not None and isinstance(args[0], ast.Name)
                    return gathered[args[0].id]
                assert name is not None
                return _FUNCTIONS[name](*(walk(a) for a in args))
        raise AssertionError(ast.dump(node))

    return walk(expression.tree)
