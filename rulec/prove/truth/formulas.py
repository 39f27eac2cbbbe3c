"""Formulas in tables: expressions of numbers and arrays over names."""

from __future__ import annotations

import ast
import functools
from collections.abc import Mapping
from types import CodeType
from typing import Any

import numpy as np

FUNCTIONS: Mapping[str, Any] = {
    **{name: getattr(np, name) for name in ("abs", "exp", "expm1", "maximum", "minimum")},
    **{name: getattr(np, name) for name in ("pi", "sin", "sqrt", "zeros_like")},
    **{"max": max, "min": min},
}
"""What every formula may use."""

PARTS = (
    *(ast.Expression, ast.Constant, ast.Name, ast.Attribute, ast.Subscript, ast.Tuple, ast.Call),
    *(ast.keyword, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp),
    *(ast.operator, ast.unaryop, ast.boolop, ast.cmpop, ast.expr_context),
)
"""What a formula may be made of; no loop, no function of its own, no name that begins with `_`."""


class Names(dict[str, Any]):
    """Values by name; what is not given is a constant, or else an attribute of `here`."""

    def __init__(self, here: object, constants: Mapping[str, Any], **given: Any) -> None:
        super().__init__(given)
        self.here, self.constants = here, {**FUNCTIONS, **constants}

    def __missing__(self, name: str) -> Any:
        return self.constants[name] if name in self.constants else getattr(self.here, name)

    def of(self, formula: str | float) -> Any:
        """Return the value of a formula; raises ValueError where it is more than an expression."""
        return eval(_compiled(str(formula)), {"__builtins__": {}}, self)

    def with_(self, **given: Any) -> Names:
        """Return the same with more names."""
        return Names(self.here, self.constants, **{**self, **given})

    def fix(self, formulas: Mapping[str, str | float]) -> None:
        """Add names with the values of formulas, each of which may use those before it."""
        for name, formula in formulas.items():
            self[name] = self.of(formula)


@functools.cache
def _compiled(formula: str) -> CodeType:
    tree = ast.parse(formula, mode="eval")
    for part in ast.walk(tree):
        name = getattr(part, "id", getattr(part, "attr", ""))
        if not isinstance(part, PARTS) or name.startswith("_"):
            raise ValueError(f"{formula!r} is no formula")
    return compile(tree, f"<{formula}>", "eval")
