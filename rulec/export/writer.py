"""From the values of a plan to statements that a person can read.

A value that is used once is inlined; others get a name. Arguments of roots, logarithms, powers and
exponentials are limited to where these are defined, and divisors are kept away from zero. Nothing
traps, and the conditions of an output say whether it agrees with the plan.
"""

from collections import Counter
from collections.abc import Iterator, Mapping

from rulec_runtime.contract.plan import UNARY, Plan

from rulec.export import limits
from rulec.export.draft import Draft
from rulec.export.program import Apply, Expression, Name, Number, apply, leaves, select

SERIES = (62.0 / 2835.0, -17.0 / 315.0, 2.0 / 15.0, -1.0 / 3.0, 1.0)
"""Coefficients of tanh(x)/x by powers of the square of x, the highest first."""


def tanh(x: Expression, size: Expression, fall: Expression) -> Expression:
    """The hyperbolic tangent of x; `size` is its absolute value, `fall` is exp(-2 size).

    Near zero by its series, where the formula would lose digits.
    """
    square = x * x
    series: Expression = Number(SERIES[0])
    for coefficient in SERIES[1:]:
        series = Number(coefficient) + square * series
    share = (Number(1.0) - fall) / (Number(1.0) + fall)
    return select(size <= limits.NEAR_LINEAR, x * series, select(x >= 0.0, share, -share))


def whole_power(a: Expression, exponent: Expression) -> Expression | None:
    """A small whole power as a product; None for others."""
    if not (isinstance(exponent, Number) and exponent.value in (1.0, 2.0, 3.0, 4.0)):
        return None
    result = a
    for _ in range(int(exponent.value) - 1):
        result = result * a
    return result


JOINED = {"add": "plus", "sub": "minus", "mul": "times", "div": "per"}
LONGEST_DESCRIPTION = 20
LEAST = limits.LEAST_DIVISOR

DEFINED = {
    "sqrt": ("max", "ge", 0.0),
    "log": ("max", "gt", LEAST),
    "pow": ("max", "gt", LEAST),
    "exp": ("min", "le", limits.LARGEST_EXPONENT),
}
"""Where operations are defined: what limits their argument, the condition, and the bound."""

Conditions = tuple[Expression, ...]


class Writer:
    """Writes the outputs of a plan into a draft, one after the other.

    `given` are the expressions of the plan's inputs, `constants` names of constants by value,
    `hints` names of values by their number.
    """

    def __init__(
        self,
        plan: Plan,
        given: Mapping[str, Expression],
        constants: Mapping[float, Name],
        draft: Draft,
        hints: Mapping[int, str] | None = None,
    ) -> None:
        self._plan, self._draft, self._hints = plan, draft, hints or {}
        self._uses = _uses(plan)
        # Values that must not be zero: the factors of all divisors.
        divisors = [b for name, _, b in plan.operations if name == "div"]
        self._divisors = frozenset(_factors(plan, divisors))
        self._context = ""
        self._done: dict[int, Expression] = {}
        self._conditions: dict[int, Conditions] = {}
        self._safe_products: dict[int, Expression] = {}
        self._far: dict[int, tuple[Expression, Expression]] = {}
        for i, name in enumerate(plan.inputs):
            self._done[i] = given[name]
            if i in self._divisors:
                self._far[i] = self._far_from_zero(i, given[name])
        for i, value in enumerate(plan.constants, len(plan.inputs)):
            self._done[i] = constants.get(value, Number(value))

    def named(self, output: str, name: str, comment: str = "") -> Name:
        """Write an output under a name, by which later expressions refer to it."""
        number = self._plan.outputs[output]
        self._context = name
        expression = self._written(number)
        self._draft.state(name, expression, comment=comment)
        if isinstance(expression, Apply):
            self._done[number] = Name(name)
        return Name(name)

    def conditions(self, output: str) -> Conditions:
        """The conditions of an output that was written before."""
        return self._conditions.get(self._plan.outputs[output], ())

    def _written(self, root: int) -> Expression:
        """Write a value and everything it needs; without recursion, as sums may be long."""
        stack = [root]
        while stack:
            number = stack[-1]
            operands = () if number in self._done else self._operands(number)
            waiting = [i for i in operands if i not in self._done]
            stack += reversed(waiting)
            if not waiting:
                stack.pop()
                if number not in self._done:
                    self._done[number] = self._operation(number, operands, number == root)
        return self._done[root]

    def _operands(self, number: int) -> tuple[int, ...]:
        name, a, b = self._plan.operations[number - self._plan.first_operation]
        return (a,) if name in UNARY else (a, b)

    def _operation(self, number: int, operands: tuple[int, ...], is_root: bool) -> Expression:
        name = self._plan.operations[number - self._plan.first_operation][0]
        parts = [self._done[i] for i in operands]
        found = [c for i in operands for c in self._conditions.get(i, ())]
        if name == "div":
            parts[1] = self._divisor(operands[1], found)
        expression, condition = self._safe(name, parts)
        self._conditions[number] = tuple(dict.fromkeys([*found, *condition]))
        if number in self._divisors:
            expression, far = self._far_from_zero(number, expression)
            self._conditions[number] = (*self._conditions[number], far)
        many = self._uses[number] > 1 or leaves(expression) > limits.LONGEST_EXPRESSION
        hinted = number in self._hints and number not in self._plan.outputs.values()
        return self._keep(expression, number) if hinted or (many and not is_root) else expression

    def _safe(self, name: str, parts: list[Expression]) -> tuple[Expression, Conditions]:
        """An operation that no argument can trap, and its conditions."""
        a = self._keep(parts[0]) if name in ("sign", "tanh", *DEFINED) else parts[0]
        if name == "pow" and (whole := whole_power(a, parts[1])) is not None:
            return whole, ()
        if name in DEFINED:
            limited, holds, bound = DEFINED[name]
            safe = apply(name, apply(limited, a, bound), *parts[1:])
            return safe, (apply(holds, a, bound),)
        if name == "sign":
            return select(a > 0.0, 1.0, select(a >= 0.0, 0.0, -1.0)), ()
        if name == "tanh":
            size = self._keep(apply("abs", a))
            return tanh(a, size, self._keep(apply("exp", Number(-2.0) * size))), ()
        return apply(name, *parts), ()

    def _far_from_zero(self, number: int, expression: Expression) -> tuple[Expression, Expression]:
        """A divisor that is never zero, and the condition that it was not zero before."""
        name = self._name(expression, number)
        raw = self._keep(expression, wanted=f"{name}_raw")
        far = apply("abs", raw) > LEAST
        return self._keep(select(far, raw, LEAST), wanted=name), far

    def _divisor(self, number: int, conditions: list[Expression]) -> Expression:
        """A divisor, with the inputs in it kept away from zero.

        Elsewhere an input stays as it is: zero may be a good reading there.
        """
        if self._far.keys().isdisjoint(_factors(self._plan, [number])):
            return self._done[number]
        if number in self._far:
            safe, far = self._far[number]
            conditions.append(far)
            return safe
        name = self._plan.operations[number - self._plan.first_operation][0]
        parts = [self._divisor(i, conditions) for i in self._operands(number)]
        if number not in self._safe_products:
            expression = self._safe(name, parts)[0]
            shared = self._uses[number] > 1
            self._safe_products[number] = self._keep(expression) if shared else expression
        return self._safe_products[number]

    def _keep(
        self, expression: Expression, number: int | None = None, wanted: str = ""
    ) -> Expression:
        """The expression under a new name, unless it is a name or a number."""
        if not isinstance(expression, Apply):
            return expression
        name = self._draft.names.new(wanted or self._name(expression, number))
        return self._draft.state(name, expression)

    def _name(self, expression: Expression, number: int | None) -> str:
        """A name for a value: as in its equation, or by its parts."""
        hint = None if number is None else self._hints.get(number)
        if isinstance(expression, Name):
            return hint or f"{expression.text}_divisor"
        return hint or _described(expression) or f"{self._context}_part"


def _uses(plan: Plan) -> Counter[int]:
    """How often each value is read: by operations, and as an output."""
    uses = Counter(plan.outputs.values())
    for name, a, b in plan.operations:
        uses.update((a,) if name in UNARY else (a, b))
    return uses


def _factors(plan: Plan, left: list[int]) -> Iterator[int]:
    """The factors of values that are products and quotients, without constants."""
    first = plan.first_operation
    visited: set[int] = set()
    while left:
        number = left.pop()
        if number in visited or len(plan.inputs) <= number < first:
            continue
        visited.add(number)
        name, a, b = plan.operations[number - first] if number >= first else ("input", 0, 0)
        if name in ("mul", "div"):
            left += [a, b]
        elif name in ("neg", "abs"):
            left.append(a)
        elif name != "exp":
            yield number


def _described(expression: Expression) -> str:
    """A name for a value by its parts; empty for long ones."""
    match expression:
        case Apply("mul", (Name(a), Name(b))) if a == b and len(a) < LONGEST_DESCRIPTION:
            return f"{a}_squared"
        case Apply("neg", (Name(a),)) if len(a) < LONGEST_DESCRIPTION:
            return f"minus_{a}"
        case Apply("add", (Name(a), Number(1.0)) | (Number(1.0), Name(a))):
            return f"one_plus_{a}"
        case Apply("sub", (Number(1.0), Name(b))):
            return f"one_minus_{b}"
        case Apply(name, (Name(a), Name(b))) if (
            name in JOINED and len(a) + len(b) < LONGEST_DESCRIPTION
        ):
            return f"{a}_{JOINED[name]}_{b}"
        case Apply("sqrt", (Apply("max", (Name(a), _)),)):
            return f"root_of_{a}"
    return ""
