"""Equations of amended module types as text: what was brought in is written out."""

from __future__ import annotations

import ast

from rulec.amend import Amended, replaced, text_of
from rulec.language.expression import Expression


def equation_of(amended: Amended, place: tuple[str, str]) -> str:
    """The equation of a place in local names, over definitions that its author wrote."""
    kind, name = place
    if kind == "observer":
        return f"{name} = {_written_out(amended, amended.type.observers[name].expression)}"
    if kind == "signal":
        true = amended.corrected.get(name)
        if true is None:
            return f"{name} = {name}"
        return f"true {name} = {_written_out(amended, amended.type.definitions[true].expression)}"
    return f"{name} = {_written_out(amended, amended.type.definitions[name].expression)}"


def _written_out(amended: Amended, expression: Expression) -> str:
    outside = {name: _name(source) for name, source in amended.outside.items()}

    def tree(inner: Expression) -> ast.expr:
        table: dict[str, ast.expr] = dict(outside)
        for name, _ in inner.names():
            if name in amended.made:
                table[name] = tree(amended.type.definitions[name].expression)
        return replaced(inner.tree, table)

    return text_of(tree(expression))


def _name(name: str) -> ast.Name:
    """A plan input such as ``B.T``, which no equation of the language could name."""
    return ast.Name(id=name, ctx=ast.Load())
