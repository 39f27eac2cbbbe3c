"""Formulas in tables: expressions of numbers and arrays over names."""

from __future__ import annotations

import ast
import functools
from collections.abc import Mapping
from dataclasses import dataclass
from types import CodeType
from typing import Any

import numpy as np

FUNCTIONS: Mapping[str, Any] = {
    **{name: getattr(np, name) for name in ("abs", "exp", "expm1", "maximum", "minimum")},
    **{name: getattr(np, name) for name in ("pi", "sin", "sqrt", "zeros_like", "amax", "amin")},
    # Methods of arrays import on their own, which a formula must not.
    "sum": np.sum,
    **{"len": len, "max": max, "min": min, "round": round},
}
"""What every formula may use."""

PARTS = (
    *(ast.Expression, ast.Constant, ast.Name, ast.Attribute, ast.Subscript, ast.Tuple, ast.Call),
    *(ast.keyword, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp),
    *(ast.operator, ast.unaryop, ast.boolop, ast.cmpop, ast.expr_context),
)
"""What a formula may be made of; no loop, no function of its own, no name that begins with `_`."""


class Names(dict[str, Any]):
    """Values by name. What is not given is a constant, or a formula of a table, which is evaluated
    when it is needed, or else an attribute of `here`."""

    def __init__(
        self,
        here: object,
        constants: Mapping[str, Any],
        table: Mapping[str, str] | None = None,
        **given: Any,
    ) -> None:
        super().__init__(given)
        self.here, self.table = here, table or {}
        self.constants = {**FUNCTIONS, **constants}

    def __missing__(self, name: str) -> Any:
        if name in self.constants:
            return self.constants[name]
        if name not in self.table:
            return getattr(self.here, name)
        self[name] = self.of(self.table[name])
        return self[name]

    def of(self, formula: str | float) -> Any:
        """Return the value of a formula; raises ValueError as `compiled` does."""
        return eval(compiled(str(formula)), {"__builtins__": {}}, self)

    def with_(self, **given: Any) -> Names:
        """Return the same with more names."""
        return Names(self.here, self.constants, self.table, **{**self, **given})

    def fix(self, formulas: Mapping[str, str | float]) -> None:
        """Add names with the values of formulas, each of which may use those before it."""
        for name, formula in formulas.items():
            self[name] = self.of(formula)


@dataclass(frozen=True)
class Drawn:
    """The size of an effect; `random` draws its shape."""

    size: float
    random: np.random.Generator

    def between(self, low: float, high: float) -> float:
        """Draw uniformly."""
        return float(self.random.uniform(low, high))

    def choice(self, *values: float) -> float:
        """Draw one of some numbers."""
        return float(self.random.choice(values))

    def signed(self, down: float = -1.0) -> float:
        """Draw the size, or `down` times it."""
        return self.size * self.choice(down, 1.0)


@functools.cache
def compiled(formula: str) -> CodeType:
    """Return the code of a formula; raises ValueError where it is more than an expression."""
    tree = ast.parse(formula, mode="eval")
    for part in ast.walk(tree):
        name = getattr(part, "id", getattr(part, "attr", ""))
        if not isinstance(part, PARTS) or name.startswith("_"):
            raise ValueError(f"{formula!r} is no formula")
    return compile(tree, f"<{formula}>", "eval")
