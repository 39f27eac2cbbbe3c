"""Units, dimensions and fixed exponents; the spellings of units are those of kb/units.yaml."""

from __future__ import annotations

import ast
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from rulec.language.limits import MAX_CONSTANT, MAX_DENOMINATOR, MAX_UNIT_LENGTH, MAX_UNIT_POWER

BASES = ("m", "kg", "s", "K", "A")


@dataclass(frozen=True)
class Dimension:
    """Exponents of m, kg, s, K and A.

    `UNKNOWN`, used after a reported mistake, fits every dimension and propagates.
    """

    exponents: tuple[Fraction, ...] = (Fraction(0),) * len(BASES)

    def fits(self, other: Dimension) -> bool:
        """Whether the two are equal or one of them is unknown."""
        return self == other or UNKNOWN in (self, other)

    def __mul__(self, other: Dimension) -> Dimension:
        if UNKNOWN in (self, other):
            return UNKNOWN
        return Dimension(tuple(a + b for a, b in zip(self.exponents, other.exponents, strict=True)))

    def __truediv__(self, other: Dimension) -> Dimension:
        return self * other**-1

    def __pow__(self, power: Fraction | int) -> Dimension:
        return Dimension(tuple(e * power for e in self.exponents))

    def __str__(self) -> str:
        """Readable form, such as ``kg m^-1 s^-2``; ``1`` for a plain number."""
        parts = [
            base if e == 1 else f"{base}^{e if e.denominator == 1 else f'({e})'}"
            for base, e in zip(BASES, self.exponents, strict=True)
            if e
        ]
        return " ".join(parts) or "1"

    @staticmethod
    def of(mapping: Mapping[str, Any]) -> Dimension:
        """From exponents by base, such as ``{"m": 3, "s": -1}``."""
        exponents = (Fraction(mapping.get(base, 0)) for base in BASES)
        return Dimension(tuple(e.limit_denominator(MAX_DENOMINATOR) for e in exponents))


NONE = Dimension()
UNKNOWN = Dimension(())
VOLUME_FLOW = Dimension.of({"m": 3, "s": -1})
TEMPERATURE = Dimension.of({"K": 1})
SECOND = Dimension.of({"s": 1})
PROPERTIES = {
    "density": Dimension.of({"kg": 1, "m": -3}),
    "viscosity": Dimension.of({"kg": 1, "m": -1, "s": -1}),
}
"""Fluid properties that equations may use, as functions of temperature."""


@dataclass(frozen=True)
class Unit:
    """A unit as written: SI value = value * factor + offset."""

    text: str
    factor: float
    dimension: Dimension
    offset: float = 0.0

    def to_si(self, value: float) -> float:
        """Convert a value from this unit to SI."""
        return value * self.factor + self.offset

    def from_si(self, value: float) -> float:
        """Convert a value from SI to this unit."""
        return (value - self.offset) / self.factor


@dataclass(frozen=True, eq=False)
class UnitTable:
    """The accepted spellings, and the quantities that signals may have.

    The zero of an `interval` quantity is arbitrary: a share of such a reading means nothing.
    """

    units: Mapping[str, Unit]
    quantities: Mapping[str, Dimension]
    interval: frozenset[str] = frozenset()

    def parse(self, text: str) -> Unit:
        """Read a unit, including compound ones such as ``l/h/bar**2`` and ``m3/h/kPa**0.5``.

        Raises ValueError with the unknown spelling as its argument.
        """
        if text in self.units:
            return self.units[text]
        if len(text) > MAX_UNIT_LENGTH or not text.isascii():
            raise ValueError(text)
        try:
            with warnings.catch_warnings(action="ignore"):
                tree = ast.parse(text, mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise ValueError(text) from None
        factor, dimension = self._walk(tree, text)
        return Unit(text, factor, dimension)

    def plain(self, dimension: Dimension) -> Unit:
        """The SI unit of a dimension."""
        if dimension == UNKNOWN:
            return Unit("1", 1.0, UNKNOWN)
        for unit in self.units.values():
            if unit.dimension == dimension and unit.factor == 1 and not unit.offset:
                return unit
        powers = list(zip(BASES, dimension.exponents, strict=True))
        above = [_power(base, e) for base, e in powers if e > 0]
        below = [f"/{_power(base, -e)}" for base, e in powers if e < 0]
        return Unit("*".join(above or ["1"]) + "".join(below), 1.0, dimension)

    def difference(self, unit: Unit) -> Unit:
        """The unit for differences of readings: kelvin for degrees Celsius."""
        if not unit.offset:
            return unit
        for other in self.units.values():
            alike = other.dimension == unit.dimension and other.factor == unit.factor
            if alike and not other.offset:
                return other
        return unit

    def like(self, dimension: Dimension) -> str:
        """The units of a dimension for a message, or the dimension if no unit has it."""
        names = [name for name, unit in self.units.items() if unit.dimension == dimension]
        return f"as in {', '.join(names[:5])}" if names else f"its dimension is {dimension}"

    def _walk(self, node: ast.AST, text: str) -> tuple[float, Dimension]:
        match node:
            case ast.Constant(value=int(value)) if value == 1 and value is not True:
                return 1.0, NONE
            case ast.Name(id=name):
                unit = self.units.get(name)
                if unit is None or unit.offset:
                    raise ValueError(name)
                return unit.factor, unit.dimension
            case ast.BinOp(left=left, op=ast.Mult(), right=right):
                (f, d), (g, e) = self._walk(left, text), self._walk(right, text)
                return f * g, d * e
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                (f, d), (g, e) = self._walk(left, text), self._walk(right, text)
                return f / g, d / e
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                power = exponent_of(right)
                if power is None or abs(power) > MAX_UNIT_POWER:
                    raise ValueError(text)
                f, d = self._walk(left, text)
                return f**power, d**power
        raise ValueError(text)


def _power(base: str, exponent: Fraction) -> str:
    """A power as written in a unit: ``m``, ``m**2``, ``m**(1/2)``."""
    if exponent == 1:
        return base
    return f"{base}**{exponent}" if exponent.denominator == 1 else f"{base}**({exponent})"


def exponent_of(node: ast.expr) -> Fraction | None:
    """Value of a numeric exponent: 2, -1, 0.5, 1/2, (7/4).

    >>> exponent_of(ast.parse("-1/3", mode="eval").body)
    Fraction(-1, 3)
    """
    match node:
        case ast.Constant(value=bool()):
            return None
        case ast.Constant(value=int(value) | float(value)) if abs(value) <= MAX_CONSTANT:
            return Fraction(value).limit_denominator(MAX_DENOMINATOR)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = exponent_of(operand)
            return None if inner is None else -inner
        case ast.BinOp(op=ast.Div(), left=left, right=right):
            top, bottom = exponent_of(left), exponent_of(right)
            return None if top is None or not bottom else top / bottom
    return None


def unit_table(data: Mapping[str, Any]) -> UnitTable:
    """Build the table from the content of kb/units.yaml."""
    units = {
        name: Unit(
            name, float(e["factor"]), Dimension.of(e["dimension"]), float(e.get("offset", 0))
        )
        for name, e in data["units"].items()
    }
    quantities = {n: Dimension.of(e["dimension"]) for n, e in data["quantities"].items()}
    interval = {n for n, e in data["quantities"].items() if e.get("scale") == "interval"}
    return UnitTable(units, quantities, frozenset(interval))
