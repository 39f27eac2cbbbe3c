"""The functions of the equation language, in one table.

A new function is one row here. If the runtime cannot calculate it yet, it also needs an operation
of that name there, in `plan.py` and `integrator.py`, and a slope in `tangent.py`.

Functions with a corner (abs, sign, min, max) are sympy functions of our own. Their derivatives stay
within the operations of a plan; sympy's would give Heaviside, DiracDelta and unevaluated
derivatives.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import sympy


class Signum(sympy.Function):  # type: ignore[misc]
    """-1, 0 or 1; its derivative counts as 0, even at the jump."""

    nargs = 1

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        return sympy.Integer(0)


class Absolute(sympy.Function):  # type: ignore[misc]
    """Absolute value; its derivative at the corner is 0."""

    nargs = 1

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        return Signum(self.args[0])


class Smaller(sympy.Function):  # type: ignore[misc]
    """The smaller of two values; where they are equal, half the derivative of each."""

    nargs = 2

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        a, b = self.args if argindex == 1 else self.args[::-1]
        return (1 + Signum(b - a)) / 2


class Larger(sympy.Function):  # type: ignore[misc]
    """The larger of two values; where they are equal, half the derivative of each."""

    nargs = 2

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        a, b = self.args if argindex == 1 else self.args[::-1]
        return (1 + Signum(a - b)) / 2


@dataclass(frozen=True, kw_only=True)
class Function:
    """A function of the language; its name is that of its operation in a plan.

    `value` calculates it from numbers, and raises ValueError or ArithmeticError where undefined;
    `symbolic` builds it in sympy; `inverse` is the sympy function that undoes it, if there is one.
    `gives` is the dimension of its value: the ``same`` as that of its arguments, which must agree,
    its ``root``, a ``plain`` number whatever the argument, or ``plain of plain``.
    With `needs_positive`, an estimate is valid only while the argument is above 0.
    """

    value: Callable[..., float]
    symbolic: Callable[..., sympy.Expr]
    gives: Literal["same", "root", "plain", "plain of plain"]
    arity: int = 1
    inverse: Callable[..., sympy.Expr] | None = None
    needs_positive: bool = False


FUNCTIONS: Mapping[str, Function] = {
    "sqrt": Function(value=math.sqrt, symbolic=sympy.sqrt, gives="root", needs_positive=True),
    "abs": Function(value=abs, symbolic=Absolute, gives="same"),
    "sign": Function(value=lambda v: (v > 0) - (v < 0), symbolic=Signum, gives="plain"),
    "exp": Function(value=math.exp, symbolic=sympy.exp, gives="plain of plain", inverse=sympy.log),
    "log": Function(
        value=math.log,
        symbolic=sympy.log,
        gives="plain of plain",
        inverse=sympy.exp,
        needs_positive=True,
    ),
    "tanh": Function(value=math.tanh, symbolic=sympy.tanh, gives="plain of plain"),
    "min": Function(value=min, symbolic=Smaller, gives="same", arity=2),
    "max": Function(value=max, symbolic=Larger, gives="same", arity=2),
}
