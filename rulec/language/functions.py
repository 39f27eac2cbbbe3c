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
from enum import Enum, auto

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


class Gives(Enum):
    """Dimension of a function's value."""

    PLAIN_OF_PLAIN = auto()
    """A plain number, if the argument is one."""
    PLAIN = auto()
    """A plain number, whatever the argument."""
    SAME = auto()
    """The dimension of the arguments, which must agree."""
    ROOT = auto()
    """The square root of the argument's dimension."""


@dataclass(frozen=True, kw_only=True)
class Function:
    """A function of the language; its name is that of its operation in a plan.

    `value` calculates it from numbers, and raises ValueError or ArithmeticError where undefined;
    `symbolic` builds it in sympy; `inverse` is the sympy function that undoes it, if there is one.
    With `needs_positive`, an estimate is valid only while the argument is above 0.
    """

    value: Callable[..., float]
    symbolic: Callable[..., sympy.Expr]
    gives: Gives
    arity: int = 1
    inverse: Callable[..., sympy.Expr] | None = None
    needs_positive: bool = False


FUNCTIONS: Mapping[str, Function] = {
    "sqrt": Function(value=math.sqrt, symbolic=sympy.sqrt, gives=Gives.ROOT, needs_positive=True),
    "abs": Function(value=abs, symbolic=Absolute, gives=Gives.SAME),
    "sign": Function(value=lambda v: (v > 0) - (v < 0), symbolic=Signum, gives=Gives.PLAIN),
    "exp": Function(
        value=math.exp, symbolic=sympy.exp, gives=Gives.PLAIN_OF_PLAIN, inverse=sympy.log
    ),
    "log": Function(
        value=math.log,
        symbolic=sympy.log,
        gives=Gives.PLAIN_OF_PLAIN,
        inverse=sympy.exp,
        needs_positive=True,
    ),
    "tanh": Function(value=math.tanh, symbolic=sympy.tanh, gives=Gives.PLAIN_OF_PLAIN),
    "min": Function(value=min, symbolic=Smaller, gives=Gives.SAME, arity=2),
    "max": Function(value=max, symbolic=Larger, gives=Gives.SAME, arity=2),
}
