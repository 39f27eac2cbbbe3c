"""Faults that add to a reading: their degree has the unit of the signal they act on.

The law of such a fault uses ``unit``, the size of one unit of the signal in SI. The range of its
degree is given in shares of the sensor's range, as no reading is off by more than that.
"""

from __future__ import annotations

import ast
from dataclasses import replace

import sympy

from rulec.knowledge.knowledge import FaultType, Variant
from rulec.knowledge.module_type import Signal
from rulec.language.rewrite import replaced, written
from rulec.language.symbolic import to_sympy
from rulec.language.units import UnitTable

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
    size, shown = signal.unit.factor, units.difference(signal.unit)
    span = (signal.full_scale or 0.0) / size
    number = ast.Constant(int(size) if size.is_integer() else size)
    law = written(replaced(variant.law.tree, {UNIT: number}))
    return replace(
        variant,
        law=law,
        lowest=variant.lowest * span,
        highest=variant.highest * span,
        unit=shown.text,
    )
