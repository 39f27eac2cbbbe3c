"""The properties of a fluid in a module: closed forms and their errors."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import sympy

from rulec.knowledge.module_type import Fluid, Parameter
from rulec.knowledge.plant import Module
from rulec.language.symbolic import TEMPERATURE, closed_form, to_sympy
from rulec.language.units import NONE, PROPERTIES, Unit


def fill(module: Module, fluid: Fluid) -> Module:
    """A module whose equations use fluid properties, with its fluid.

    Each property has an error factor: a hidden parameter of value 1. Its error is shared by all
    modules with this fluid, so that it cancels where they are compared. Signals that are the
    temperature of a property get the fluid's range.
    """
    factors = {}
    for name in module.type.asks:
        part, factor = fluid.properties[name], factor_name(fluid, name)
        factors[factor] = Parameter(
            name=factor,
            value=1.0,
            u=part.u,
            unit=Unit("1", 1.0, NONE),
            fit=False,
            lowest=0.0,
            title=f"error of the {part.name} of {fluid.title}",
            origin=part.origin,
            shared=True,
        )
    names = (name for e in module.type.equations() for name in e.thermometers())
    thermometers = [name for name in names if name in module.type.signals]
    ranges = dict.fromkeys(thermometers, (fluid.lowest, fluid.highest))
    return replace(
        module,
        type=replace(module.type, fluid=fluid, parameters={**module.type.parameters, **factors}),
        parameters={**module.parameters, **factors},
        valid={**ranges, **module.valid},
    )


def property_at(source: str) -> tuple[str, str]:
    """Fluid property ("" if none) and reading that drive a law.

    >>> property_at("viscosity(pump.T)"), property_at("pump.T")
    (('viscosity', 'pump.T'), ('', 'pump.T'))
    """
    name, bracket, rest = source.partition("(")
    is_property = bracket and name in PROPERTIES and rest.endswith(")")
    return (name, rest[:-1]) if is_property else ("", source)


def reading_of(source: str) -> str:
    """The reading that drives a law, directly or through a fluid property."""
    return property_at(source)[1]


def factor_name(fluid: Fluid, name: str) -> str:
    """Name of the hidden error factor of a property, such as ``density(water)``."""
    return f"{name}({fluid.name})"


def closed_forms(
    fluid: Fluid | None, symbols: Mapping[str, sympy.Expr]
) -> dict[str, Callable[[sympy.Expr], sympy.Expr]]:
    """Properties as functions of temperature (K); `symbols` holds their error factors."""
    if fluid is None:
        return {}
    return {
        name: partial(_at, fluid, name, symbols[factor_name(fluid, name)])
        for name in fluid.properties
        if factor_name(fluid, name) in symbols
    }


def _at(fluid: Fluid, name: str, factor: sympy.Expr, temperature: sympy.Expr) -> sympy.Expr:
    return factor * closed_form(name, property_of(fluid, name))(temperature)


def property_of(fluid: Fluid, name: str) -> sympy.Expr:
    """A property as a function of `TEMPERATURE`, with numbers for all else, SI."""
    table = {"T": TEMPERATURE, **{n: sympy.Float(v) for n, v in fluid.coefficients.items()}}
    for part, expression in fluid.definitions.items():
        table[part] = to_sympy(expression, table)
    for part, own in fluid.properties.items():
        table[part] = to_sympy(own.expression, table)
    return table[name]
