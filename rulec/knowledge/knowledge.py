"""General knowledge of equipment: the checked content of kb/, in SI."""

import ast
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import sympy

from rulec.knowledge.effect import Effect, Usual
from rulec.knowledge.liquid import Liquid
from rulec.knowledge.module_type import FaultUse, Fluid, Frequency, ModuleType, Signal
from rulec.language.diagnostics import Origin, Place
from rulec.language.expression import Expression, replaced, written
from rulec.language.symbolic import to_sympy
from rulec.language.units import Unit, UnitTable


@dataclass(frozen=True)
class SensorError:
    """An error of a class of sensors: a fault that acts on a signal.

    Without a `frequency`, that of the fault applies.
    """

    fault: str
    place: Place
    frequency: Frequency | None = None


@dataclass(frozen=True, kw_only=True)
class SensorClass:
    """Systematic uncertainty of a class of sensors.

    `standard` is the standard uncertainty, bound over coverage factor. `kind` is ``full scale`` or
    ``reading`` (then `standard` is a fraction) or ``value`` (then `standard` is in SI). `cost` is
    that of one more installed sensor, relative to the other classes. `measures` is the quantity for
    which advice may propose it if no signal is declared. Any reading of the class may have one of
    its `errors`, whatever its module lists.
    """

    name: str
    title: str
    kind: str
    standard: float
    unit: Unit
    cost: float
    measures: str
    origin: Origin
    errors: tuple[SensorError, ...] = ()

    def uncertainty(self, full_scale: float | None, reading: float) -> float:
        """Standard uncertainty of a reading, SI."""
        size = {"full scale": full_scale or 0.0, "reading": abs(reading), "value": 1.0}
        return self.standard * size[self.kind]


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One direction of a fault: `law` gives the faulty value from the healthy one.

    `unit` is that of the degree, and empty if it is a share. Without a `frequency`, that of the
    fault applies.
    """

    name: str
    title: str
    law: Expression
    lowest: float
    highest: float
    meaning: str
    unit: str = ""
    usual: Usual | None = None
    frequency: Frequency | None = None

    @property
    def scale(self) -> float:
        """Degrees divided by this are shares: of the fault's target, or of the sensor's range."""
        return self.highest if self.unit else 1.0


@dataclass(frozen=True, kw_only=True)
class FaultType:
    """What a fault does; sign, gain, rule and matrix row are derived from it.

    `frequency` is None if not stated. `liquid` describes a fault of the liquid, which acts on all
    modules at once. It cannot act on the quantity `not_of`.
    """

    name: str
    title: str
    acts_on: str
    variants: tuple[Variant, ...]
    tolerance: float
    status: str
    text: str
    action: str
    origin: Origin
    frequency: Frequency | None = None
    liquid: Liquid | None = None
    not_of: str = ""

    def title_at(self, target: str, variant: Variant) -> str:
        """Title of one of its variants, acting on `target`."""
        return f"{target} {variant.title}" if variant.name else self.title


@dataclass(frozen=True, kw_only=True)
class Knowledge:
    """The checked knowledge base."""

    units: UnitTable
    sensors: Mapping[str, SensorClass]
    faults: Mapping[str, FaultType]
    modules: Mapping[str, ModuleType]
    fluids: Mapping[str, Fluid]
    effects: Mapping[str, Effect] = field(default_factory=dict)

    def fault_in(self, use: FaultUse) -> FaultType:
        """A fault in a module type, whose own frequency, if any, replaces those of all variants."""
        fault = self.faults[use.fault]
        if use.frequency is None:
            return fault
        variants = tuple(replace(v, frequency=None) for v in fault.variants)
        return replace(fault, frequency=use.frequency, variants=variants)


# Faults that add to a reading: their degree has the unit of the signal they act on.
#
# The law of such a fault uses ``unit``, the size of one unit of the signal in SI. The range of its
# degree is given in shares of the sensor's range, as no reading is off by more than that. A fault
# that adds to a flow states the unit, and the range in it.

UNIT = "unit"


def adds(fault: FaultType) -> bool:
    """Whether the degree of a fault is in the unit of the signal."""
    return any(name == UNIT for v in fault.variants for name, _ in v.law.names())


def scales_from_zero(fault: FaultType) -> bool:
    """Whether the degree is a share of a reading, so that the reading needs a true zero."""
    x = sympy.Symbol("x", real=True)
    at_zero = [
        to_sympy(v.law, {"g": sympy.S.Zero, "x": x, UNIT: sympy.S.One}) for v in fault.variants
    ]
    return fault.acts_on == "signal" and all(law == 0 for law in at_zero)


def has_no_zero(signal: Signal, units: UnitTable) -> bool:
    """Whether the zero of a signal is arbitrary, as that of degrees Celsius."""
    return bool(signal.unit.offset) or signal.quantity in units.interval


def for_signal(variant: Variant, signal: Signal | None, units: UnitTable) -> Variant:
    """A variant as it acts on one signal; unchanged if its degree is a share."""
    if signal is None or not any(name == UNIT for name, _ in variant.law.names()):
        return variant
    shown = units.difference(signal.unit)
    span = (signal.full_scale or 0.0) / signal.unit.factor
    return replace(
        variant,
        law=with_unit(variant.law, signal.unit),
        lowest=variant.lowest * span,
        highest=variant.highest * span,
        unit=shown.text,
    )


def with_unit(law: Expression, unit: Unit) -> Expression:
    """The law of a fault with the size of one unit put in, SI."""
    size = unit.factor
    number = ast.Constant(int(size) if size.is_integer() else size)
    return written(replaced(law.tree, {UNIT: number}))
