"""Check a fault: its law must use only g and x, change nothing at degree 0, and be solvable."""

from collections.abc import Mapping
from typing import Any

import sympy

from rulec.knowledge.check_length import check_law
from rulec.knowledge.effect import USUAL_HINT, usual_of
from rulec.knowledge.knowledge import UNIT, FaultType, Variant, with_unit
from rulec.knowledge.liquid import read_liquid
from rulec.knowledge.module_type import Frequency
from rulec.language.expression import Expression
from rulec.language.read_yaml import Path_
from rulec.language.reader import Reader
from rulec.language.symbolic import invert, to_sympy
from rulec.language.units import VOLUME_FLOW, Unit


def check_fault(reader: Reader) -> FaultType:
    """Read a fault type; the reader collects the mistakes."""
    data, before = reader.document.data, len(reader.found)
    parts = data.get("variants") or {"": data}
    variants = []
    for name, part in parts.items():
        path: Path_ = ("variants", name) if name else ()
        degree, unit = part["degree"], _unit(reader, (*path, "degree"))
        lowest, highest = degree["range"]
        reader.check_range(lowest, highest, *path, "degree", "range")
        variants.append(
            Variant(
                name=name,
                title=part["title"],
                law=_law(reader, (*path, "law"), unit),
                lowest=lowest,
                highest=highest,
                meaning=degree["meaning"],
                unit="" if unit is None else unit.text,
                usual=usual_of(degree),
                frequency=frequency_at(reader, path, part) if name else None,
            )
        )
    for name, part in parts.items() if len(reader.found) == before else ():
        if "usual" not in part["degree"]:
            path = ("variants", name, "degree") if name else ("degree",)
            message = "how large this fault usually is is missing"
            reader.report_key(path, "KB108", message, USUAL_HINT)
    if "not_of" in data:
        reader.quantity("not_of")
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
        not_of=data.get("not_of", ""),
    )


def frequency_at(
    reader: Reader, path: Path_, part: Mapping[str, Any], source: str = "frequency_source"
) -> Frequency | None:
    """Frequency of the fault described at a path, if stated; `source` is the key of its source."""
    if "frequency" not in part:
        return None
    origin = reader.origin(*path, "frequency", source=part.get(source, ""))
    return Frequency(part["frequency"], origin)


def _unit(reader: Reader, path: Path_) -> Unit | None:
    """The unit that the degree of a flow states; that of a signal is known only there."""
    if "unit" not in reader.part(path):
        return None
    if reader.document.data["acts_on"] != "flow":
        message, hint = "only the degree of a fault of a flow states a unit", "take it out"
        reader.report_key((*path, "unit"), "KB020", message, hint)
        return None
    return reader.unit_of(VOLUME_FLOW, "volume flow", *path, "unit")


def _law(reader: Reader, path: Path_, unit: Unit | None) -> Expression:
    """Read the law of a fault: over g and x only, equal to g at x = 0, solvable for both. If its
    degree has a unit, this is put in, in SI."""
    before = len(reader.found)
    expression = reader.expression(*path)
    sized = unit is not None or reader.document.data["acts_on"] == "signal"
    known = {"g", "x", UNIT} if sized else {"g", "x"}
    for name, column in (*expression.names(), *expression.gathered(), *expression.properties()):
        if name not in known:
            message = f"the law of a fault speaks of g and x only, not of '{name}'"
            hint = (
                "g: what should be there, x: the degree; unit: one unit of the signal, or of the "
                "flow, if the degree states its unit"
            )
            reader.report_word(path, column, name, "KB061", message, hint)
    if len(reader.found) > before or not check_law(reader, path, expression):
        return expression
    needed = {"g", "x"} | ({UNIT} if unit else set())
    missing = sorted(needed - {name for name, _ in expression.names()})
    if missing:
        message = f"'{missing[0]}' does not occur in the law"
        hint = "as in g - x*unit" if unit else "as in (1 + x)*g"
        reader.report(path, "KB062", message, hint)
        return expression
    g, x, value = sympy.symbols("g x value", real=True)
    law = to_sympy(expression, {"g": g, "x": x, UNIT: sympy.S.One})
    if invert(law, g, value) is None or invert(law, x, value) is None:
        message = "this law cannot be solved for g and x"
        reader.report(path, "KB064", message, "let g and x occur once each")
    elif sympy.expand(law.subs(x, 0) - g) != 0:
        message = "at degree 0 this law does not give g back"
        reader.report(path, "KB063", message, "a fault of degree 0 must change nothing")
    return with_unit(expression, unit) if unit else expression
