"""Each operation of a tape as code for LLVM: its value and its derivatives.

They do what `evaluate` in `integrator.py` does, operation by operation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from rulec_runtime.simulation.llvm_code import Code, number

ONE, MINUS = "one", "minus"
"""Factors that need no multiplication."""


@dataclass(frozen=True)
class Numbers:
    """Numbers of the integrator that the code needs: edges of functions, nodes and weights of the
    stages; and addresses of functions that LLVM lacks."""

    tiny: float
    steepest: float
    nodes: tuple[float, ...]
    weights: tuple[float, ...]
    functions: Mapping[str, int]


def _div(code: Code, numbers: Numbers, x: str, y: str, by: Wanted) -> Ruled:
    none = code.calc("fcmp oeq", y, number(0.0))
    y = code.choose(none, number(numbers.tiny), y)
    v = code.calc("fdiv", x, y)
    by_left = code.calc("fdiv", number(1.0), y) if by[0] else None
    by_right = code.calc("fdiv", code.put(f"fneg double {v}"), y) if by[1] else None
    return v, by_left, by_right


def _pow(code: Code, numbers: Numbers, x: str, y: str, by: Wanted) -> Ruled:
    zero, one = number(0.0), number(1.0)
    base = code.choose(code.calc("fcmp olt", x, zero), zero, x)
    none = code.calc("fcmp oeq", base, zero)
    raised = code.call(numbers.functions["pow"], base, y)
    at_zero = code.choose(code.calc("fcmp ogt", y, zero), zero, one)
    v = code.choose(none, at_zero, raised)
    by_left = by_right = None
    if by[0]:
        steep = code.calc("fdiv", code.calc("fmul", y, v), base)
        line = code.choose(code.calc("fcmp oeq", y, one), y, zero)
        by_left = code.choose(none, line, steep)
    if by[1]:
        steep = code.calc("fmul", v, code.call(numbers.functions["log"], base))
        by_right = code.choose(none, zero, steep)
    return v, by_left, by_right


def _either(comparison: str) -> Rule:
    def rule(code: Code, numbers: Numbers, x: str, y: str, by: Wanted) -> Ruled:
        zero, one = number(0.0), number(1.0)
        left = code.calc(comparison, x, y)
        by_left = code.choose(left, one, zero) if by[0] else None
        by_right = code.choose(left, zero, one) if by[1] else None
        return code.choose(left, x, y), by_left, by_right

    return rule


def _sqrt(code: Code, numbers: Numbers, x: str, y: str, by: Wanted) -> Ruled:
    there = code.calc("fcmp ogt", x, number(numbers.tiny))
    root = code.put(f"call double @llvm.sqrt.f64(double {x})")
    by_left = None
    if by[0]:
        by_left = code.choose(there, code.calc("fdiv", number(0.5), root), number(0.0))
    return code.choose(there, root, number(0.0)), by_left, None


def _abs(code: Code, numbers: Numbers, x: str, y: str, by: Wanted) -> Ruled:
    up = code.calc("fcmp oge", x, number(0.0))
    by_left = code.choose(up, number(1.0), number(-1.0)) if by[0] else None
    return code.put(f"call double @llvm.fabs.f64(double {x})"), by_left, None


def _sign(code: Code, numbers: Numbers, x: str, y: str, by: Wanted) -> Ruled:
    zero = number(0.0)
    below = code.choose(code.calc("fcmp olt", x, zero), number(-1.0), zero)
    return code.choose(code.calc("fcmp ogt", x, zero), number(1.0), below), None, None


def _exp(code: Code, numbers: Numbers, x: str, y: str, by: Wanted) -> Ruled:
    most = number(numbers.steepest)
    x = code.choose(code.calc("fcmp ogt", x, most), most, x)
    v = code.call(numbers.functions["exp"], x)
    return v, v, None


def _log(code: Code, numbers: Numbers, x: str, y: str, by: Wanted) -> Ruled:
    least = number(numbers.tiny)
    x = code.choose(code.calc("fcmp olt", x, least), least, x)
    by_left = code.calc("fdiv", number(1.0), x) if by[0] else None
    return code.call(numbers.functions["log"], x), by_left, None


def _tanh(code: Code, numbers: Numbers, x: str, y: str, by: Wanted) -> Ruled:
    v = code.call(numbers.functions["tanh"], x)
    by_left = code.calc("fsub", number(1.0), code.calc("fmul", v, v)) if by[0] else None
    return v, by_left, None


Wanted = tuple[bool, bool]
"""Whether the derivatives by both operands are wanted."""

Ruled = tuple[str, str | None, str | None]
"""The value, and its derivatives by both operands."""

Rule = Callable[[Code, Numbers, str, str, Wanted], Ruled]

RULES: Mapping[str, Rule] = {
    "add": lambda code, _, x, y, by: (code.calc("fadd", x, y), ONE, ONE),
    "sub": lambda code, _, x, y, by: (code.calc("fsub", x, y), ONE, MINUS),
    "mul": lambda code, _, x, y, by: (code.calc("fmul", x, y), y, x),
    "div": _div,
    "pow": _pow,
    "min": _either("fcmp ole"),
    "max": _either("fcmp oge"),
    "neg": lambda code, _, x, y, by: (code.put(f"fneg double {x}"), MINUS, None),
    "sqrt": _sqrt,
    "abs": _abs,
    "sign": _sign,
    "exp": _exp,
    "log": _log,
    "tanh": _tanh,
}
"""The operations, as `evaluate` in `integrator.py` has them."""

DECLARED = ("declare double @llvm.sqrt.f64(double)", "declare double @llvm.fabs.f64(double)")

CALLED = frozenset({"pow", "exp", "log", "tanh"})
"""Operations that are functions at an address; the derivative of `pow` needs `log` too."""
