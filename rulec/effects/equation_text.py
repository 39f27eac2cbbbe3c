"""Equations of amended module types as text, with new definitions written out."""

from __future__ import annotations

import ast

from rulec.language.expression import Expression
from rulec.language.rewrite import name_node, replaced, text_of
from rulec.passes.amend import Amended


def equation_of(amended: Amended, place: tuple[str, str]) -> str:
    """The equation of a place in local names, over definitions that its author wrote."""
    kind, name = place
    if kind == "observer":
        return f"{name} = {_written_out(amended, amended.type.observers[name].expression)}"
    if kind == "balance":
        return f"d{name}/dt = {_written_out(amended, amended.type.states[name].rate)}"
    if kind == "reading":
        return f"{name} = {_written_out(amended, amended.type.readings[name].expression)}"
    if kind == "signal" or (kind == "end" and name not in amended.type.definitions):
        true = amended.corrected.get(name)
        if true is None:
            return f"{name} = {name}"
        return f"true {name} = {_written_out(amended, amended.type.definitions[true].expression)}"
    return f"{name} = {_written_out(amended, amended.type.definitions[name].expression)}"


def _written_out(amended: Amended, expression: Expression) -> str:
    # Such as B.T, which no equation of the language could name.
    outside = {name: name_node(source) for name, source in amended.outside.items()}

    def tree(inner: Expression) -> ast.expr:
        table: dict[str, ast.expr] = dict(outside)
        for name, _ in inner.names():
            if name in amended.made:
                table[name] = tree(amended.type.definitions[name].expression)
        return replaced(inner.tree, table)

    return text_of(tree(expression))
