"""Check a fluid: its equations speak of T, fit their dimensions, and give something positive."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain
from math import sqrt

import numpy as np

from rulec.knowledge.check_length import check_lengths
from rulec.knowledge.module_type import Fluid, Property
from rulec.language.diagnostics import Diagnostic, Place, did_you_mean
from rulec.language.dimension import dimension
from rulec.language.document import Document
from rulec.language.expression import Expression, Rejected, constant
from rulec.language.part_readers import origin_of, read_expression, read_unit, within
from rulec.language.units import NONE, PROPERTIES, TEMPERATURE, UNKNOWN, Dimension, UnitTable

POINTS = 25
"""Temperatures over the valid range at which a property is tried out."""


def check_fluid(document: Document, units: UnitTable, found: list[Diagnostic]) -> Fluid:
    """Read a fluid; mistakes are added to `found`."""
    return _FluidReader(document, units, found).read()


@dataclass
class _FluidReader:
    """Reads one fluid document; `known` are the dimensions of the names so far."""

    document: Document
    units: UnitTable
    found: list[Diagnostic] = field(repr=False)
    known: dict[str, Dimension] = field(default_factory=lambda: {"T": TEMPERATURE})

    def read(self) -> Fluid:
        data, before = self.document.data, len(self.found)
        lowest, highest = self._range()
        coefficients = {name: self._coefficient(name) for name in data["coefficients"]}
        definitions = {name: self._definition(name) for name in data.get("definitions", {})}
        properties = {name: self._property(name) for name in PROPERTIES}
        fluid = Fluid(
            name=data["fluid"],
            title=data["title"],
            lowest=lowest,
            highest=highest,
            coefficients=coefficients,
            definitions=definitions,
            properties=properties,
        )
        if len(self.found) == before:
            check_lengths(self.document, _named(fluid), (), self.found)
        if len(self.found) == before:
            self._check_used(fluid)
            self._check_positive(fluid)
        return fluid

    def _report(
        self, place: Place, code: str, message: str, hint: str = "", second: Place | None = None
    ) -> None:
        self.found.append(Diagnostic(place, code, message, hint, second))

    def _range(self) -> tuple[float, float]:
        part, path = self.document.data["valid"]["T"], ("valid", "T")
        unit = read_unit(self.document, (*path, "unit"), self.units, self.found)
        if not unit.dimension.fits(TEMPERATURE):
            place, hint = self.document.place(*path, "unit"), self.units.like(TEMPERATURE)
            self._report(place, "KB053", f"'{unit.text}' is not a unit of temperature", hint)
        if not part["from"] < part["to"]:
            place = self.document.place(*path, "to")
            self._report(place, "KB055", "the range is empty", "lower end first")
        return unit.to_si(part["from"]), unit.to_si(part["to"])

    def _coefficient(self, name: str) -> float:
        unit = read_unit(self.document, ("coefficients", name, "unit"), self.units, self.found)
        self._declare("coefficients", name, unit.dimension)
        return unit.to_si(self.document.data["coefficients"][name]["value"])

    def _declare(self, group: str, name: str, own: Dimension) -> None:
        if name in self.known or name in PROPERTIES:
            twin = group == "definitions" and name in self.document.data["coefficients"]
            second = self.document.key("coefficients", name) if twin else None
            place, message = self.document.key(group, name), f"the name '{name}' means two things"
            self._report(place, "KB034", message, "rename one", second)
        self.known.setdefault(name, own)

    def _definition(self, name: str) -> Expression:
        expression, own = self._equation("definitions", name, "is")
        self._declare("definitions", name, own)
        return expression

    def _property(self, name: str) -> Property:
        expression, own = self._equation(name, "is")
        if not own.fits(PROPERTIES[name]):
            message = f"a {name} is {PROPERTIES[name]}, but this is {own}"
            place = self.document.place(name, "is")
            self._report(place, "KB060", message, "check each factor")
        self.known[name] = PROPERTIES[name]
        part = self.document.data[name]
        unit = read_unit(self.document, (name, "error", "unit"), self.units, self.found)
        if not unit.dimension.fits(NONE):
            message = f"the error is a share, but '{unit.text}' is {unit.dimension}"
            place = self.document.place(name, "error", "unit")
            self._report(place, "KB053", message, "write '%'")
        u = part["error"]["bound"] * unit.factor / sqrt(3.0)
        return Property(name, expression, u, origin_of(self.document, name, source=part["source"]))

    def _equation(self, *path: str) -> tuple[Expression, Dimension]:
        """An equation over the names so far, and its dimension; UNKNOWN after a mistake."""
        before = len(self.found)
        expression = read_expression(self.document, path, self.found)
        place = self.document.place(*path)
        for name, column in chain(expression.properties(), expression.gathered()):
            spot = within(place, column, len(name), expression.text)
            message = f"'{name}' cannot be asked for in an equation of a fluid"
            self._report(spot, "KB044", message, "what stands above is known by its name alone")
        for name, column in expression.names():
            if name not in self.known:
                spot = within(place, column, len(name), expression.text)
                message = f"'{name}' is neither T, coefficient nor definition above"
                self._report(spot, "KB036", message, did_you_mean(name, self.known))
        if len(self.found) > before:
            return expression, UNKNOWN
        try:
            return expression, dimension(expression, self.known, {})
        except Rejected as error:
            spot = within(place, error.column, error.length, expression.text)
            self._report(spot, error.code, error.message, error.hint)
            return expression, UNKNOWN

    def _check_used(self, fluid: Fluid) -> None:
        used = {name for _, e in _equations(fluid) for name, _ in e.names()}
        for name in fluid.coefficients:
            if name not in used:
                place = self.document.key("coefficients", name)
                message = f"no equation uses the coefficient '{name}'"
                self._report(place, "KB038", message, "remove it or use it")

    def _check_positive(self, fluid: Fluid) -> None:
        """Try the equations out over the valid range: a slip of sign or unit shows there."""
        for T in np.linspace(fluid.lowest, fluid.highest, POINTS):
            known: dict[str, float] = {"T": float(T), **fluid.coefficients}
            for path, expression in _equations(fluid):
                place = self.document.place(*path)
                try:
                    known[path[-2]] = value = constant(expression, known) or 0.0
                except Rejected as error:
                    message = f"at {T:.4g} K this is no number"
                    hint = "is it the sign of a coefficient, or its unit? T counts in K"
                    spot = within(place, error.column, error.length, expression.text)
                    self._report(spot, "KB067", message, hint)
                    return
                if path[0] in PROPERTIES and not value > 0:
                    message = f"at {T:.4g} K this gives {value:.3g}, but a {path[0]} is positive"
                    self._report(place, "KB067", message, "is a sign wrong, or a unit?")
                    return


def _named(fluid: Fluid) -> Iterator[tuple[str, tuple[str, ...], Expression]]:
    """All equations in order: what each is known by, its place, itself."""
    for path, expression in _equations(fluid):
        yield path[-2], path, expression


def _equations(fluid: Fluid) -> Iterator[tuple[tuple[str, ...], Expression]]:
    """All equations in order, with their places in the file."""
    for name, expression in fluid.definitions.items():
        yield ("definitions", name, "is"), expression
    for name, part in fluid.properties.items():
        yield (name, "is"), part.expression
