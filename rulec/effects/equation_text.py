"""Equations of amended module types as text, with new definitions expanded."""

from __future__ import annotations

import ast

from rulec.language.expression import Expression
from rulec.language.rewrite import name_node, replaced, text_of
from rulec.passes.amend import Amended


def equation_of(amended: Amended, place: tuple[str, str]) -> str:
    """The equation of a place in local names and the definitions that its author wrote."""
    kind, name = place
    own = amended.type
    if kind == "observer":
        left, right = name, own.observers[name].expression
    elif kind == "balance":
        left, right = f"d{name}/dt", own.states[name].rate
    elif kind == "reading":
        left, right = name, own.readings[name].expression
    elif kind == "definition" or name in own.definitions:
        left, right = name, own.definitions[name].expression
    elif name in amended.corrected:
        left, right = f"true {name}", own.definitions[amended.corrected[name]].expression
    else:
        return f"{name} = {name}"
    return f"{left} = {_written_out(amended, right)}"


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
