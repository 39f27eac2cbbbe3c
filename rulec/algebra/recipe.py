"""A sympy expression as a list of steps, made once and replayed for every instance."""

import functools
from collections.abc import Iterable, Mapping
from typing import Any

import sympy
from rulec_runtime.contract.plan import UNARY

from rulec.algebra.graph import Graph, Node
from rulec.language.functions import FUNCTIONS
from rulec.language.symbolic import ClosedForm
from rulec.limits import MULTIPLIED_POWER

Step = tuple[str, Any, int]
"""``("symbol", sympy symbol, 0)``, ``("constant", number, 0)`` or ``(operation, step, step)``."""


def lower(graph: Graph, expression: sympy.Expr, symbols: Mapping[sympy.Symbol, Node]) -> Node:
    """Build the node of a sympy expression; `symbols` gives the nodes of its symbols."""
    return lower_all(graph, (expression,), symbols)[0]


def lower_all(
    graph: Graph, expressions: Iterable[sympy.Expr], symbols: Mapping[sympy.Symbol, Node]
) -> list[Node]:
    """Build several expressions over the same symbols."""
    recipe, results = recipe_of(tuple(expressions))
    nodes: list[Node] = []
    for kind, a, b in recipe:
        if kind == "symbol":
            nodes.append(symbols[a])
        elif kind == "constant":
            nodes.append(graph.constant(a))
        else:
            nodes.append(graph.apply(kind, nodes[a], nodes[b]))
    return [nodes[i] for i in results]


@functools.lru_cache(maxsize=100_000)
def recipe_of(expressions: tuple[sympy.Expr, ...]) -> tuple[tuple[Step, ...], tuple[int, ...]]:
    """Steps that build the expressions, and the number of each expression's step.

    >>> x = sympy.Symbol("x")
    >>> recipe_of((x - 1,))[0]
    (('symbol', x, 0), ('constant', 1.0, 0), ('sub', 0, 1))
    """
    writer = _Writer()
    results = tuple(writer.write(e) for e in expressions)
    return tuple(writer.steps), results


class _Writer:
    def __init__(self) -> None:
        self.steps: list[Step] = []
        self._numbers: dict[sympy.Expr, int] = {}

    def write(self, expression: sympy.Expr) -> int:
        """Number of the step that gives an expression."""
        if expression not in self._numbers:
            self._numbers[expression] = self._new(expression)
        return self._numbers[expression]

    def _append(self, kind: str, a: Any, b: int = 0) -> int:
        self.steps.append((kind, a, b))
        return len(self.steps) - 1

    def _new(self, expression: sympy.Expr) -> int:
        if expression.is_Symbol:
            return self._append("symbol", expression)
        if expression.is_Number or expression.is_NumberSymbol:
            return self._append("constant", float(expression))
        if isinstance(expression, ClosedForm):
            return self.write(expression.written_out())
        if isinstance(expression, sympy.Add):
            return self._sum(expression)
        if isinstance(expression, sympy.Mul):
            return self._product(expression)
        if isinstance(expression, sympy.Pow):
            return self._power(self.write(expression.base), expression.exp)
        name = _NAMES.get(expression.func)
        if name is None:
            raise TypeError(f"no operation for {expression.func}")
        steps = [self.write(a) for a in expression.args]
        if name in UNARY:
            return self._append(name, steps[0])
        result = steps[0]
        for step in steps[1:]:
            result = self._append(name, result, step)
        return result

    def _sum(self, expression: sympy.Add) -> int:
        """Positive terms first, then those subtracted."""
        plus = [a for a in expression.args if not a.could_extract_minus_sign()]
        minus = [-a for a in expression.args if a.could_extract_minus_sign()]
        if plus:
            result = self.write(plus[0])
            for term in plus[1:]:
                result = self._append("add", result, self.write(term))
        else:
            result = self._append("neg", self.write(minus.pop(0)))
        for term in minus:
            result = self._append("sub", result, self.write(term))
        return result

    def _product(self, expression: sympy.Mul) -> int:
        top, bottom = [], []
        for argument in expression.args:
            if isinstance(argument, sympy.Pow) and argument.exp.is_negative:
                bottom.append(argument.base**-argument.exp)
            else:
                top.append(argument)
        if not bottom:
            return self._times(top)
        numerator = self._times(top) if top else self._append("constant", 1.0)
        return self._append("div", numerator, self._times(bottom))

    def _times(self, factors: list[sympy.Expr]) -> int:
        result = self.write(factors[0])
        for factor in factors[1:]:
            result = self._append("mul", result, self.write(factor))
        return result

    def _power(self, base: int, exponent: sympy.Expr) -> int:
        if exponent.is_negative:
            return self._append("div", self._append("constant", 1.0), self._power(base, -exponent))
        if exponent.is_Integer and int(exponent) <= MULTIPLIED_POWER:
            result = base
            for _ in range(int(exponent) - 1):
                result = self._append("mul", result, base)
            return result
        if exponent == sympy.Rational(1, 2):
            return self._append("sqrt", base)
        if (2 * exponent).is_Integer:
            root = self._append("sqrt", base)
            rest = self._power(base, exponent - sympy.Rational(1, 2))
            return self._append("mul", rest, root)
        return self._append("pow", base, self._append("constant", float(exponent)))


_NAMES = {sympy.Abs: "abs"} | {f.symbolic: name for name, f in FUNCTIONS.items()}
