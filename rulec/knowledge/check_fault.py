"""Check a fault: its law must use only g and x, change nothing at degree 0, and be solvable."""

from collections.abc import Mapping
from typing import Any

import sympy

from rulec.knowledge.check_length import check_law
from rulec.knowledge.effect import USUAL_HINT, usual_of
from rulec.knowledge.knowledge import UNIT, FaultType, Variant
from rulec.knowledge.liquid import read_liquid
from rulec.knowledge.module_type import Frequency
from rulec.language.expression import Expression
from rulec.language.read_yaml import Path_
from rulec.language.reader import Reader
from rulec.language.symbolic import invert, to_sympy


def check_fault(reader: Reader) -> FaultType:
    """Read a fault type; the reader collects the mistakes."""
    data, before = reader.document.data, len(reader.found)
    parts = data.get("variants") or {"": data}
    variants = []
    for name, part in parts.items():
        path: Path_ = ("variants", name) if name else ()
        lowest, highest = part["degree"]["range"]
        reader.check_range(lowest, highest, *path, "degree", "range")
        variants.append(
            Variant(
                name=name,
                title=part["title"],
                law=_law(reader, (*path, "law")),
                lowest=lowest,
                highest=highest,
                meaning=part["degree"]["meaning"],
                usual=usual_of(part["degree"]),
                frequency=frequency_at(reader, path, part) if name else None,
            )
        )
    for name, part in parts.items() if len(reader.found) == before else ():
        if "usual" not in part["degree"]:
            path = ("variants", name, "degree") if name else ("degree",)
            message = "how large this fault usually is is missing"
            reader.report_key(path, "KB108", message, USUAL_HINT)
    return FaultType(
        name=data["fault"],
        title=data["title"],
        acts_on=data["acts_on"],
        variants=tuple(variants),
        tolerance=data["tolerance"],
        status=data["status"],
        text=data["text"],
        action=data["action"],
        origin=reader.origin("fault", source=data["source"]),
        frequency=frequency_at(reader, (), data),
        liquid=read_liquid(reader),
    )


def frequency_at(
    reader: Reader, path: Path_, part: Mapping[str, Any], source: str = "frequency_source"
) -> Frequency | None:
    """Frequency of the fault described at a path, if stated; `source` is the key of its source."""
    if "frequency" not in part:
        return None
    origin = reader.origin(*path, "frequency", source=part.get(source, ""))
    return Frequency(part["frequency"], origin)


def _law(reader: Reader, path: Path_) -> Expression:
    """Read the law of a fault: over g and x only, equal to g at x = 0, solvable for both."""
    before = len(reader.found)
    expression = reader.expression(*path)
    known = {"g", "x", UNIT} if reader.document.data["acts_on"] == "signal" else {"g", "x"}
    for name, column in (*expression.names(), *expression.gathered(), *expression.properties()):
        if name not in known:
            message = f"the law of a fault speaks of g and x only, not of '{name}'"
            hint = "g: what should be there, x: the degree; of a signal also unit: one of its units"
            reader.report_word(path, column, name, "KB061", message, hint)
    if len(reader.found) > before or not check_law(reader, path, expression):
        return expression
    missing = sorted({"g", "x"} - {name for name, _ in expression.names()})
    if missing:
        message = f"'{missing[0]}' does not occur in the law"
        reader.report(path, "KB062", message, "as in (1 + x)*g")
        return expression
    g, x, value = sympy.symbols("g x value", real=True)
    law = to_sympy(expression, {"g": g, "x": x, UNIT: sympy.S.One})
    if invert(law, g, value) is None or invert(law, x, value) is None:
        message = "this law cannot be solved for g and x"
        reader.report(path, "KB064", message, "let g and x occur once each")
    elif sympy.expand(law.subs(x, 0) - g) != 0:
        message = "at degree 0 this law does not give g back"
        reader.report(path, "KB063", message, "a fault of degree 0 must change nothing")
    return expression
