"""Constants of a plan by the names of the parameters that they are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import isclose

from rulec_runtime.contract.ruleset import ParameterSpec, Ruleset
from rulec_runtime.recordings.reading_unit import parse_unit

from rulec import limits
from rulec.export.identifiers import Identifiers
from rulec.export.program import Parameter


def named_constants(
    ruleset: Ruleset, module: str, constants: Iterable[float], names: Identifiers
) -> tuple[Parameter, ...]:
    """Those constants that are one parameter of the module, and no other one."""
    known = list(_values(ruleset, module))
    found = []
    for value in constants:
        same = [p for p, si in known if isclose(si, value, rel_tol=limits.SAME_CONSTANT)]
        if len(same) == 1 and abs(value) != 1.0 and value != 0.0:
            found.append(Parameter(names.new(_short(same[0])), value, _text(same[0])))
    return tuple(found)


def _values(ruleset: Ruleset, module: str) -> Iterator[tuple[ParameterSpec, float]]:
    """Parameters of a module with their values in SI."""
    for parameter in ruleset.parameters:
        if parameter.id.startswith(f"{module}."):
            unit = parse_unit(parameter.unit, ruleset.units)
            factor, offset = (1.0, 0.0) if unit is None else (unit.factor, unit.offset)
            yield parameter, parameter.value * factor + offset


def _short(parameter: ParameterSpec) -> str:
    return parameter.id.partition(".")[2]


def _text(parameter: ParameterSpec) -> str:
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    return f"{parameter.value:.6g}{unit}, {parameter.origin}"
