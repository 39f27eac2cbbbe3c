"""The form between plan and code: routines of assignments, with no loop and no jump.

Every name is assigned once and before it is read, so a routine means the same in any language.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial, reduce
from typing import Any, Literal

import numpy as np
from rulec_runtime.contract.plan import OPERATIONS

Kind = Literal["real", "bool"]


class Operand:
    """Python's operators build expressions; numbers become constants."""

    def __add__(self, other: Written) -> Apply:
        return apply("add", self, other)

    def __sub__(self, other: Written) -> Apply:
        return apply("sub", self, other)

    def __mul__(self, other: Written) -> Apply:
        return apply("mul", self, other)

    def __truediv__(self, other: Written) -> Apply:
        return apply("div", self, other)

    def __neg__(self) -> Apply:
        return apply("neg", self)

    def __and__(self, other: Written) -> Apply:
        return apply("and", self, other)

    def __ge__(self, other: Written) -> Apply:
        return apply("ge", self, other)

    def __gt__(self, other: Written) -> Apply:
        return apply("gt", self, other)

    def __le__(self, other: Written) -> Apply:
        return apply("le", self, other)


@dataclass(frozen=True)
class Number(Operand):
    """A constant."""

    value: float


@dataclass(frozen=True)
class Name(Operand):
    """An input, a parameter, an output, or a value calculated before."""

    text: str


@dataclass(frozen=True)
class Apply(Operand):
    """An operation on operands.

    For numbers, those of `rulec_runtime.contract.plan.OPERATIONS` without ``sign`` and ``tanh``,
    which no PLC has. ``ge``, ``gt``, ``le`` compare; ``and``, ``not`` combine; ``select`` takes a
    condition, the value if it is true, and the value if it is false.
    """

    operation: str
    operands: tuple[Expression, ...]


Expression = Number | Name | Apply
Written = Operand | float


@dataclass(frozen=True)
class Statement:
    """A value, calculated once."""

    name: str
    expression: Expression
    kind: Kind = "real"
    comment: str = ""


@dataclass(frozen=True)
class Section:
    """Statements that belong together; `title` heads them as a comment."""

    title: str
    statements: tuple[Statement, ...]


@dataclass(frozen=True)
class Variable:
    """An input or output; `id` identifies it in the plant, as in ``q:A.pump``."""

    name: str
    id: str
    kind: Kind
    unit: str
    text: str


@dataclass(frozen=True)
class Parameter:
    """A constant with a name, SI; `text` gives it in its unit, with its source."""

    name: str
    value: float
    text: str


@dataclass(frozen=True, kw_only=True)
class Routine:
    """A function for a controller; each output is assigned by the statement of its name."""

    name: str
    text: str
    inputs: tuple[Variable, ...]
    parameters: tuple[Parameter, ...]
    sections: tuple[Section, ...]
    outputs: tuple[Variable, ...]

    @property
    def statements(self) -> tuple[Statement, ...]:
        """All statements in order."""
        return tuple(s for section in self.sections for s in section.statements)


@dataclass(frozen=True)
class ModuleCode:
    """All routines of a module; `head` is the head of its files."""

    module: str
    name: str
    head: tuple[str, ...]
    routines: tuple[Routine, ...]


def apply(operation: str, *operands: Written) -> Apply:
    """An operation."""
    parts: Any = tuple(e if isinstance(e, Operand) else Number(e) for e in operands)
    return Apply(operation, parts)


def select(condition: Expression, if_true: Written, if_false: Written) -> Apply:
    """One of two values."""
    return apply("select", condition, if_true, if_false)


def total(terms: list[Expression]) -> Expression:
    """Sum from left to right; 0 for no terms."""
    return reduce(partial(apply, "add"), terms) if terms else Number(0.0)


def every(conditions: Iterable[Expression]) -> Expression:
    """The conjunction of at least one condition, without those that others imply."""
    given = dict.fromkeys(conditions)
    strict = {c.operands for c in given if isinstance(c, Apply) and c.operation == "gt"}
    implied = {Apply("ge", operands) for operands in strict}
    return reduce(partial(apply, "and"), (c for c in given if c not in implied))


def leaves(expression: Expression) -> int:
    """The number of names and numbers in an expression."""
    if isinstance(expression, Apply):
        return sum(leaves(e) for e in expression.operands)
    return 1


def names_in(expression: Expression) -> set[str]:
    """Names that an expression reads."""
    if isinstance(expression, Apply):
        return {name for e in expression.operands for name in names_in(e)}
    return {expression.text} if isinstance(expression, Name) else set()


def without_unused(routine: Routine) -> Routine:
    """The routine without the statements and parameters that no output needs."""
    read: set[str] = set()
    wanted = {v.name for v in routine.outputs}
    sections = []
    for section in reversed(routine.sections):
        statements = []
        for statement in reversed(section.statements):
            if statement.name in wanted or statement.name in read:
                statements.append(statement)
                read |= names_in(statement.expression)
        if statements:
            sections.append(Section(section.title, tuple(reversed(statements))))
    parameters = tuple(p for p in routine.parameters if p.name in read)
    return replace(routine, parameters=parameters, sections=tuple(reversed(sections)))


Value = Any
"""A number or truth value, or an array of them."""

LOGIC: Mapping[str, Callable[..., Value]] = {
    "ge": np.greater_equal,
    "gt": np.greater,
    "le": np.less_equal,
    "and": np.logical_and,
    "not": np.logical_not,
    "select": np.where,
}


def run(routine: Routine, values: Mapping[str, Value]) -> dict[str, Value]:
    """Outputs of a routine by name; `values` are those of its inputs, or arrays of shape (n,), in
    the units of the inputs."""
    defined: dict[str, Value] = {v.name: values[v.name] for v in routine.inputs}
    defined |= {p.name: p.value for p in routine.parameters}
    # Readings are compared before the routine knows that they are not numbers.
    with np.errstate(all="ignore"):
        for statement in routine.statements:
            defined[statement.name] = evaluated(statement.expression, defined)
    return {v.name: defined[v.name] for v in routine.outputs}


def evaluated(expression: Expression, defined: Mapping[str, Value]) -> Value:
    """Value of an expression."""
    match expression:
        case Number(value):
            return value
        case Name(text):
            return defined[text]
        case Apply(operation, operands):
            function = LOGIC.get(operation) or OPERATIONS[operation]
            return function(*(evaluated(e, defined) for e in operands))
