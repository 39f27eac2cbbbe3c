"""Check a fault: its law must speak of g and x, vanish at degree 0, and be solvable."""

from __future__ import annotations

import sympy

from rulec.knowledge.check_length import check_law
from rulec.knowledge.degree_unit import UNIT
from rulec.knowledge.knowledge import FaultType, Variant
from rulec.language.diagnostics import Diagnostic
from rulec.language.document import Document
from rulec.language.expression import Expression
from rulec.language.invert import invert
from rulec.language.part_readers import origin_of, read_expression, within
from rulec.language.symbolic import to_sympy


def check_fault(document: Document, found: list[Diagnostic]) -> FaultType:
    data = document.data
    parts = data.get("variants") or {"": data}
    variants = []
    for name, part in parts.items():
        path: tuple[str | int, ...] = ("variants", name) if name else ()
        law = _law(document, (*path, "law"), found)
        lowest, highest = part["degree"]["range"]
        if not lowest < highest:
            spot = document.place(*path, "degree", "range")
            found.append(Diagnostic(spot, "KB055", "the range is empty", "lower end first"))
        title = part["title"]
        variants.append(
            Variant(
                name=name,
                title=title,
                law=law,
                lowest=lowest,
                highest=highest,
                meaning=part["degree"]["meaning"],
            )
        )
    return FaultType(
        name=data["fault"],
        title=data["title"],
        acts_on=data["acts_on"],
        variants=tuple(variants),
        tolerance=data["tolerance"],
        status=data["status"],
        text=data["text"],
        action=data["action"],
        origin=origin_of(document, "fault", source=data["source"]),
    )


def _law(document: Document, path: tuple[str | int, ...], found: list[Diagnostic]) -> Expression:
    """Read the law of a fault: only g and x, g when x is 0, solvable for both."""
    before = len(found)
    expression = read_expression(document, path, found)
    place = document.place(*path)
    for name, column in (*expression.names(), *expression.gathered(), *expression.properties()):
        if name == UNIT and document.data["acts_on"] == "signal":
            continue
        if name not in ("g", "x"):
            spot = within(place, column, len(name), expression.text)
            message = f"the law of a fault speaks of g and x only, not of '{name}'"
            hint = "g: what should be there, x: the degree; of a signal also unit: one of its units"
            found.append(Diagnostic(spot, "KB061", message, hint))
    if len(found) > before or not check_law(document, path, expression, found):
        return expression
    missing = sorted({"g", "x"} - {name for name, _ in expression.names()})
    if missing:
        message = f"'{missing[0]}' does not occur in the law"
        found.append(Diagnostic(place, "KB062", message, "as in (1 + x)*g"))
        return expression
    g, x, value = sympy.symbols("g x value", real=True)
    try:
        law = to_sympy(expression, {"g": g, "x": x, UNIT: sympy.S.One})
    except ValueError:  # sympy: min and max of something that may not be real
        law = sympy.nan
    if invert(law, g, value) is None or invert(law, x, value) is None:
        message = "this law cannot be solved for g and x"
        found.append(Diagnostic(place, "KB064", message, "let g and x occur once each"))
    elif sympy.expand(law.subs(x, 0) - g) != 0:
        message = "at degree 0 this law does not give g back"
        found.append(Diagnostic(place, "KB063", message, "a fault of degree 0 must change nothing"))
    return expression
