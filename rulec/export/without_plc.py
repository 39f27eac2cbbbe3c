"""Functions that no PLC has, composed of operations that it has."""

from __future__ import annotations

from rulec.export import limits
from rulec.export.program import Expression, Number, apply

ZERO, ONE = Number(0.0), Number(1.0)

SERIES = (62.0 / 2835.0, -17.0 / 315.0, 2.0 / 15.0, -1.0 / 3.0, 1.0)
"""Coefficients of tanh(x)/x by powers of the square of x, the highest first."""


def sign(x: Expression) -> Expression:
    """-1, 0 or 1."""
    below = apply("select", apply("ge", x, ZERO), ZERO, Number(-1.0))
    return apply("select", apply("gt", x, ZERO), ONE, below)


def tanh(x: Expression, size: Expression, fall: Expression) -> Expression:
    """The hyperbolic tangent of x; `size` is its absolute value, `fall` is exp(-2 size).

    Near zero by its series, where the formula would lose digits.
    """
    square = apply("mul", x, x)
    series: Expression = Number(SERIES[0])
    for coefficient in SERIES[1:]:
        series = apply("add", Number(coefficient), apply("mul", square, series))
    share = apply("div", apply("sub", ONE, fall), apply("add", ONE, fall))
    far = apply("select", apply("ge", x, ZERO), share, apply("neg", share))
    near = apply("le", size, Number(limits.NEAR_LINEAR))
    return apply("select", near, apply("mul", x, series), far)


def whole_power(a: Expression, exponent: Expression) -> Expression | None:
    """A small whole power as a product; None for others."""
    if not (isinstance(exponent, Number) and exponent.value in (1.0, 2.0, 3.0, 4.0)):
        return None
    result = a
    for _ in range(int(exponent.value) - 1):
        result = apply("mul", result, a)
    return result
