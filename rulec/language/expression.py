"""Equation text to a checked expression, by a whitelist over Python's `ast`.

Nothing is ever evaluated. Only numbers, declared names, + - * /, powers with a fixed exponent and
a short list of functions are allowed; all else is refused with its column. sympy's own parser is
not used, because `E`, `I`, `N` and `beta` are ordinary names here.
"""

import ast
import keyword
import math
import operator
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeVar

from rulec_runtime.output.nearest import did_you_mean

from rulec.language.functions import FUNCTIONS
from rulec.language.limits import (
    MAX_CONSTANT,
    MAX_EQUATION_DEPTH,
    MAX_EQUATION_LENGTH,
    MAX_EXPONENT,
)
from rulec.language.units import PROPERTIES, exponent_of

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,40}")
ARITY = {name: f.arity for name, f in FUNCTIONS.items()} | dict.fromkeys(PROPERTIES, 1)
GATHER = "downstream"

T = TypeVar("T")


class Rejected(ValueError):
    """Raised for an expression outside the language; `column` counts from 0."""

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
        for name, node in self._calls():
            if name == GATHER:
                argument = node.args[0]
                assert isinstance(argument, ast.Name)
                yield argument.id, argument.col_offset

    def properties(self) -> Iterator[tuple[str, int]]:
        """Fluid properties used, as in ``density(T)``, with their columns."""
        yield from ((name, n.col_offset) for name, n in self._calls() if name in PROPERTIES)

    def guarded(self) -> Iterator[ast.expr]:
        """Arguments that must be positive, such as those of roots and logarithms."""
        for name, node in self._calls():
            if name in FUNCTIONS and FUNCTIONS[name].needs_positive:
                yield node.args[0]

    def thermometers(self) -> Iterator[str]:
        """Names that are by themselves the temperature of a property."""
        for name, node in self._calls():
            if name in PROPERTIES and isinstance(node.args[0], ast.Name):
                yield node.args[0].id

    def _calls(self) -> Iterator[tuple[str, ast.Call]]:
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Call):
                yield function_of(node) or "", node

    def __str__(self) -> str:
        return self.text


def parse(text: str) -> Expression:
    """Read an expression; raises `Rejected` for anything outside the language.

    >>> parse("sqrt((dp - k0)/k2)").text
    'sqrt((dp - k0)/k2)'
    """
    return checked(syntax_tree(text), text)


def syntax_tree(text: str, also: str = "") -> ast.expr:
    """The tree of a text, not yet checked; columns are those of the text.

    `also` are signs that may stand in it besides those of an equation. Raises `Rejected`.
    """
    if len(text) > MAX_EQUATION_LENGTH:
        message = f"the equation has {len(text)} characters; at most {MAX_EQUATION_LENGTH} are read"
        raise Rejected("KB042", 0, message, "split it with definitions", len(text))
    if not text.strip():
        raise Rejected("KB040", 0, "the equation is empty")
    _refuse_text(text, also)
    indent = len(text) - len(text.lstrip())
    line = text.strip().replace("\r", " ").replace("\n", " ")
    try:
        with warnings.catch_warnings(action="ignore"):
            tree = ast.parse(line, mode="eval").body
    except SyntaxError as error:
        end = indent + len(line) - 1
        column = min(error.offset - 1 + indent, end) if error.offset else end
        if "nested" in error.msg:
            raise Rejected("KB042", column, _TOO_DEEP, "split it with definitions") from None
        message = f"the equation {'cannot be read from' if error.offset else 'breaks off'} here"
        raise Rejected("KB040", column, message, "is a *, a bracket or a number missing?") from None
    except (ValueError, RecursionError, MemoryError):
        raise Rejected("KB042", 0, _TOO_DEEP, "split it with definitions") from None
    for node in ast.walk(tree):
        if isinstance(node, ast.expr):
            node.col_offset += indent
            node.end_col_offset = (node.end_col_offset or 0) + indent
    return tree


def checked(tree: ast.expr, text: str = "") -> Expression:
    """A tree as an expression, with the given text or one made from it; raises `Rejected` if it is
    not in the language."""
    _check(tree, 0, Fraction(1))
    expression = Expression(text or text_of(tree), tree)
    constant(expression, {})
    return expression


_TOO_DEEP = f"the equation is nested more than {MAX_EQUATION_DEPTH} deep"
_FOREIGN = re.compile(r"//|[^A-Za-z0-9_+\-*/(),. \t\r\n]")
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_REMEDIES = {
    "^": "write ** for a power",
    "²": "write **2",
    "³": "write **3",
    "·": "write *",
    "×": "write *",
    "÷": "write /",
    "−": "write -, the plain minus",
    "–": "write -, the plain minus",
    "√": "write sqrt(...)",
    "[": "use round brackets",
    "{": "use round brackets",
    "=": "write the right-hand side only",
    "<": "use min(...) or max(...)",
    ">": "use min(...) or max(...)",
    "%": "write 0.01*",
}


def _refuse_text(text: str, also: str) -> None:
    """Refuse foreign characters but `also`, and reserved words, before Python's parser reads."""
    foreign = next((f for f in _FOREIGN.finditer(text) if f[0] not in tuple(also)), None)
    if foreign:
        shown = foreign[0] if foreign[0].isprintable() else f"{ord(foreign[0]):#04x}"
        hint = _REMEDIES.get(foreign[0], "numbers, names, + - * / ** ( ) and functions only")
        message = f"'{shown}' is not allowed in an equation"
        raise Rejected("KB040", foreign.start(), message, hint, len(foreign[0]))
    for word in _WORD.finditer(text):
        if keyword.iskeyword(word[0]):
            message = f"'{word[0]}' is a reserved word and cannot stand in an equation"
            raise Rejected("KB024", word.start(), message, "use another name", len(word[0]))


def rejected_at(
    node: ast.expr | ast.keyword, code: str, message: str, hint: str = "", length: int = 0
) -> Rejected:
    """A mistake at a node that covers `length` characters, or by default the whole node."""
    size = length or (node.end_col_offset or 0) - node.col_offset
    return Rejected(code, node.col_offset, message, hint, max(1, size))


def _check(node: ast.expr, depth: int, power: Fraction) -> None:
    """Refuse every construct not listed; `power` is the product of all enclosing exponents."""
    if depth > MAX_EQUATION_DEPTH:
        raise rejected_at(node, "KB042", _TOO_DEEP, "split it with definitions")
    match node:
        case ast.Constant(value=bool() | str() | bytes() | complex() | None):
            raise rejected_at(node, "KB041", "only numbers and names are allowed here")
        case ast.Constant(value=int() | float()):
            pass
        case ast.Name(id=name):
            if not NAME.fullmatch(name):
                hint = "a letter, then at most 40 letters, digits and _"
                raise rejected_at(node, "KB041", f"'{name[:50]}' is not a legal name", hint)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            _check(operand, depth + 1, power)
        case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div(), left=left, right=right):
            _check(left, depth + 1, power)
            _check(right, depth + 1, power)
        case ast.BinOp(op=ast.Pow(), left=left, right=right):
            _check(right, depth + 1, power)
            own = exponent_of(right)
            if own is None:
                raise rejected_at(right, "KB043", "an exponent must be a fixed number")
            total = power * max(Fraction(1), abs(own))
            if total > MAX_EXPONENT:
                hint = f"{MAX_EXPONENT} at most, powers of powers too"
                raise rejected_at(right, "KB043", "this power is too high", hint)
            _check(left, depth + 1, total)
        case ast.Call():
            _check_call(node, depth, power)
        case ast.Tuple(elts=parts):
            column = (parts[0].end_col_offset if parts else None) or node.col_offset
            raise Rejected("KB041", column, "a comma is not allowed here", "write a decimal point")
        case ast.Attribute(value=value):
            column = value.end_col_offset or 0
            hint = "write names without a dot, and * between factors"
            raise Rejected("KB041", column, "a dot is not allowed here", hint)
        case _:
            raise rejected_at(node, "KB041", "this is not allowed in an equation")


def _check_call(node: ast.Call, depth: int, power: Fraction) -> None:
    name = function_of(node)
    if name is None:
        raise rejected_at(node, "KB041", "only a function can be called", "is a * missing?")
    if name != GATHER and name not in ARITY:
        hint = did_you_mean(name, [*ARITY, GATHER])
        raise rejected_at(node, "KB044", f"there is no function '{name[:50]}'", hint, len(name))
    starred = [a for a in node.args if isinstance(a, ast.Starred)]
    if node.keywords or starred:
        odd = node.keywords[0] if node.keywords else starred[0]
        raise rejected_at(odd, "KB041", f"{name}() takes plain values only")
    if name == GATHER:
        if len(node.args) != 1 or not isinstance(node.args[0], ast.Name):
            message = f"{GATHER}() takes the one name that modules provide"
            raise rejected_at(node, "KB045", message, f"as in {GATHER}(name)")
    elif len(node.args) != ARITY[name]:
        wanted, example = ("2 values", "a, b") if ARITY[name] == 2 else ("1 value", "a")
        message = f"{name}() takes {wanted}, not {len(node.args)}"
        raise rejected_at(node, "KB045", message, f"as in {name}({example})")
    for argument in node.args:
        _check(argument, depth + 1, power)


def function_of(node: ast.Call) -> str | None:
    """Name of the called function; None if something other than a name is called."""
    return node.func.id if isinstance(node.func, ast.Name) else None


def _names(node: ast.expr) -> Iterator[tuple[str, int]]:
    match node:
        case ast.Name(id=name):
            yield name, node.col_offset
        case ast.Call():
            if function_of(node) != GATHER:
                for argument in node.args:
                    yield from _names(argument)
        case ast.UnaryOp(operand=operand):
            yield from _names(operand)
        case ast.BinOp(left=left, right=right):
            yield from _names(left)
            if not isinstance(node.op, ast.Pow):
                yield from _names(right)


ARITHMETIC: Mapping[str, Callable[..., Any]] = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "div": operator.truediv,
    "pow": operator.pow, "neg": operator.neg,
}  # fmt: skip
"""Operations of an equation that are no functions, as a plan names them."""

_NAMED = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div", ast.Pow: "pow"}


def fold(
    node: ast.expr, leaf: Callable[[ast.expr], T], operation: Callable[[str, Any, list[Any]], T]
) -> T:
    """What a checked tree is worth: a number, a dimension, a formula.

    `leaf` is what a number, a name or a sum downstream is worth; `operation` what one of
    `ARITHMETIC` or a function is, by its name, its node and its operands. The second operand of a
    power is its exponent, a fraction.
    """
    match node:
        case ast.UnaryOp(op=op, operand=operand):
            inner = fold(operand, leaf, operation)
            return operation("neg", node, [inner]) if isinstance(op, ast.USub) else inner
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return operation("pow", node, [fold(left, leaf, operation), exponent_of(right)])
        case ast.BinOp(left=left, op=op, right=right):
            parts = [fold(left, leaf, operation), fold(right, leaf, operation)]
            return operation(_NAMED[type(op)], node, parts)
        case ast.Call(args=args) if (name := function_of(node)) and name != GATHER:
            return operation(name, node, [fold(argument, leaf, operation) for argument in args])
    return leaf(node)


def constant(expression: Expression, values: Mapping[str, float]) -> float | None:
    """Value of an expression of known names only, else None; raises `Rejected` if a part has none.

    A fluid property that is known by its name has that value, whatever its temperature. sympy would
    evaluate such a part exactly, which never ends for a power of powers.
    """

    def leaf(node: ast.expr) -> float | None:
        if isinstance(node, ast.Constant):
            return bounded(node, float, node.value)
        return values.get(node.id) if isinstance(node, ast.Name) else None

    def operation(name: str, node: Any, parts: list[Any]) -> float | None:
        if name == "div" and parts[1] == 0:
            raise rejected_at(node.right, "KB041", "this divides by zero")
        if name in PROPERTIES:
            return values.get(name)
        if None in parts:
            return None
        return bounded(node, ARITHMETIC.get(name) or FUNCTIONS[name].value, *parts)

    def bounded(node: ast.expr, function: Callable[..., Any], *parts: Any) -> float:
        try:
            number = float(function(*parts))
        except (ArithmeticError, ValueError, TypeError):
            number = math.nan
        if not abs(number) <= MAX_CONSTANT:
            hint = f"of size {MAX_CONSTANT:g} at most"
            raise rejected_at(node, "KB041", "this is not a number one can calculate with", hint)
        return number

    return fold(expression.tree, leaf, operation)


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
