"""Values of the equations of a module type at one point."""

import math
from collections.abc import Mapping

from rulec.knowledge.module_type import ModuleType
from rulec.language.expression import Expression, Rejected, constant


def values_at(kind: ModuleType, given: Mapping[str, float]) -> dict[str, float]:
    """Values of definitions, observers, readings and rates of states, SI.

    `given` holds readings, states and, as `density` and `viscosity`, properties of the fluid;
    parameters that it does not hold are those of the type, and properties those of its fluid, if it
    has one. Equations with an unknown name are left out; one that fails there, as by a root of a
    negative number, gives NaN.
    """
    defined = {p.name: p.value for p in kind.parameters.values()} | dict(given)
    defined = _properties(kind, defined) | defined
    for definition in kind.definitions.values():
        if (value := _value(definition.expression, defined)) is not None:
            defined[definition.name] = value
    parts = {o.name: o.expression for o in kind.observers.values()}
    parts |= {r.name: r.expression for r in kind.readings.values()}
    parts |= {s.name: s.rate for s in kind.states.values()}
    values = {name: _value(expression, defined) for name, expression in parts.items()}
    found = {name: defined[name] for name in kind.definitions if name in defined} | values
    return {name: value for name, value in found.items() if value is not None}


def _properties(kind: ModuleType, given: Mapping[str, float]) -> dict[str, float]:
    """Properties of the fluid of a type, SI, at the mean of known temperatures that it reads."""
    names = {name for e in kind.equations() for name in e.thermometers() if name in given}
    if kind.fluid is None or not names:
        return {}
    values = {"T": sum(given[name] for name in names) / len(names), **kind.fluid.coefficients}
    parts = dict(kind.fluid.definitions)
    parts |= {name: part.expression for name, part in kind.fluid.properties.items()}
    for name, expression in parts.items():
        if (value := _value(expression, values)) is not None:
            values[name] = value
    return {name: values[name] for name in kind.fluid.properties if name in values}


def _value(expression: Expression, defined: Mapping[str, float]) -> float | None:
    try:
        return constant(expression, defined)
    except Rejected:  # not every equation has a value everywhere
        return math.nan
