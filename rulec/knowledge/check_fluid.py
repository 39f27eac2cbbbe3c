"""Check a fluid: its equations use T, have the right dimensions, and give positive values."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import sqrt

import numpy as np

from rulec.knowledge.check_length import check_lengths
from rulec.knowledge.limits import FLUID_POINTS
from rulec.knowledge.module_type import Fluid, Property
from rulec.language.expression import Expression, Rejected, constant
from rulec.language.read_yaml import Path_
from rulec.language.reader import Reader
from rulec.language.units import NONE, PROPERTIES, TEMPERATURE, UNKNOWN, Dimension


@dataclass
class FluidReader(Reader):
    """Reads one fluid document; `dimensions` holds the dimensions of the names so far."""

    dimensions: dict[str, Dimension] = field(default_factory=lambda: {"T": TEMPERATURE})

    def read(self) -> Fluid:
        """The fluid, in SI."""
        data, before = self.document.data, len(self.found)
        self.check_own_names(("coefficients", "definitions"), ("T", *PROPERTIES))
        valid = self.part(("valid", "T"))
        unit = self.unit_of(TEMPERATURE, "temperature", "valid", "T", "unit")
        self.check_range(valid["from"], valid["to"], "valid", "T", "to")
        fluid = Fluid(
            name=data["fluid"],
            title=data["title"],
            lowest=unit.to_si(valid["from"]),
            highest=unit.to_si(valid["to"]),
            coefficients={name: self._coefficient(name) for name in data["coefficients"]},
            definitions={name: self._definition(name) for name in data.get("definitions", {})},
            properties={name: self._property(name) for name in PROPERTIES},
        )
        if len(self.found) == before:
            check_lengths(self, _equations(fluid), ())
        if len(self.found) == before:
            self._check_used(fluid)
            self._check_positive(fluid)
        return fluid

    def _coefficient(self, name: str) -> float:
        unit = self.unit("coefficients", name, "unit")
        self.dimensions.setdefault(name, unit.dimension)
        return unit.to_si(self.part(("coefficients", name, "value")))

    def _definition(self, name: str) -> Expression:
        expression, own = self._equation("definitions", name, "is")
        self.dimensions.setdefault(name, own)
        return expression

    def _property(self, name: str) -> Property:
        expression, own = self._equation(name, "is")
        if not own.fits(PROPERTIES[name]):
            message = f"a {name} is {PROPERTIES[name]}, but this is {own}"
            self.report((name, "is"), "KB060", message, "check each factor")
        self.dimensions[name] = PROPERTIES[name]
        part = self.document.data[name]
        unit = self.unit(name, "error", "unit")
        if not unit.dimension.fits(NONE):
            message = f"the error is a share, but '{unit.text}' is {unit.dimension}"
            self.report((name, "error", "unit"), "KB053", message, "write '%'")
        u = part["error"]["bound"] * unit.factor / sqrt(3.0)
        return Property(name, expression, u, self.origin(name, source=part["source"]))

    def _equation(self, *path: str) -> tuple[Expression, Dimension]:
        """An equation over the names so far, and its dimension, `UNKNOWN` after a mistake."""
        before = len(self.found)
        expression = self.expression(*path)
        hint = "what stands above is known by its name alone"
        self.check_own(path, expression, "an equation of a fluid", hint)
        self.check_names(path, expression, self.dimensions, "T, coefficient nor definition above")
        if len(self.found) > before:
            return expression, UNKNOWN
        return expression, self.dimension(path, expression, self.dimensions)

    def _check_used(self, fluid: Fluid) -> None:
        used = {name for _, e in _equations(fluid) for name, _ in e.names()}
        for name in fluid.coefficients:
            if name not in used:
                message = f"no equation uses the coefficient '{name}'"
                self.report_key(("coefficients", name), "KB038", message, "remove it or use it")

    def _check_positive(self, fluid: Fluid) -> None:
        """Evaluate the equations over the valid range, to find slips of sign or unit."""
        for T in np.linspace(fluid.lowest, fluid.highest, FLUID_POINTS):
            values: dict[str, float] = {"T": float(T), **fluid.coefficients}
            for path, expression in _equations(fluid):
                try:
                    values[str(path[-2])] = value = constant(expression, values) or 0.0
                except Rejected as error:
                    error.code, error.message = "KB067", f"at {T:.4g} K this is no number"
                    error.hint = "is it the sign of a coefficient, or its unit? T counts in K"
                    self.report_error(path, error)
                    return
                if path[0] in PROPERTIES and not value > 0:
                    message = f"at {T:.4g} K this gives {value:.3g}, but a {path[0]} is positive"
                    self.report(path, "KB067", message, "is a sign wrong, or a unit?")
                    return


def _equations(fluid: Fluid) -> Iterator[tuple[Path_, Expression]]:
    for name, expression in fluid.definitions.items():
        yield ("definitions", name, "is"), expression
    for name, part in fluid.properties.items():
        yield (name, "is"), part.expression
