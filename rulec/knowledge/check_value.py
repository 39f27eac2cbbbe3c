"""Check the value of a parameter: it has the sign, or lies in the range, that its type says."""

from __future__ import annotations

from rulec.knowledge.module_type import Parameter
from rulec.language.document import Path_
from rulec.language.reader import Reader


def check_value(reader: Reader, path: Path_, parameter: Parameter) -> None:
    """Report the value at a path that its parameter cannot have; 0 without `u` is no quantity."""
    name, value, unit = parameter.name, parameter.value, parameter.unit
    shown = "" if unit.text == "1" else f" {unit.text}"
    if parameter.highest < float("inf"):
        if not parameter.lowest <= value <= parameter.highest:
            ends = [f"{unit.from_si(e):g}" for e in (parameter.lowest, parameter.highest)]
            message = f"'{name}' lies between {' and '.join(ends)}{shown}"
            reader.report((*path, "value"), "KB125", message, "correct it, or the range")
    elif parameter.lowest >= 0.0 and (value < 0.0 or (value == 0.0 and parameter.u > 0.0)):
        message = f"'{name}' is positive, but its value is {unit.from_si(value):g}{shown}"
        hint = "if it may be zero or negative, say 'sign: any' in the module type"
        reader.report((*path, "value"), "KB125", message, hint)
