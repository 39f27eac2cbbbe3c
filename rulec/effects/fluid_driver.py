"""Properties of a plant's fluid as drivers: they follow from the temperature."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array, Plan

from rulec.algebra.tangent import run_with_slopes
from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.module_type import Fluid
from rulec.knowledge.plant import Plant
from rulec.language.units import TEMPERATURE, Unit
from rulec.passes.lower import lower_property


@dataclass(frozen=True)
class FluidDriver:
    """A property of a fluid at a temperature reading, shown in `unit`."""

    name: str
    signal: str
    fluid: Fluid
    unit: Unit

    @property
    def id(self) -> str:
        """Such as ``viscosity(pump.T)``."""
        return f"{self.name}({self.signal})"

    def local(self, module: str) -> str:
        """The same in the names of a module: ``viscosity(T)``."""
        return f"{self.name}({self.signal.removeprefix(f'{module}.')})"

    @cached_property
    def _plan(self) -> Plan:
        return lower_property(self.fluid, self.name)

    def at(self, temperature: Array) -> tuple[Array, Array]:
        """The property and its slope over temperatures, shape (n,), SI."""
        values, slopes = run_with_slopes(self._plan, {"T": temperature}, ["T"])
        shape = np.shape(temperature)
        slope = slopes[self.name].get("T", np.zeros(shape))
        return np.broadcast_to(values[self.name], shape), np.broadcast_to(slope, shape)

    def knows(self, temperature: Array) -> bool:
        """Are the equations of the fluid valid at all readings?"""
        known = temperature[np.isfinite(temperature)]
        inside = (known >= self.fluid.lowest) & (known <= self.fluid.highest)
        return len(known) > 0 and bool(inside.all())


def drivers_at(plant: Plant, name: str, module: str, like: str = "") -> list[FluidDriver]:
    """A property at each thermometer of a module; with `like`, only if both have the same fluid."""
    there = plant.modules[module]
    fluid, units = there.fluid, plant.knowledge.units
    if fluid is None or name not in fluid.properties:
        return []
    if like and plant.modules[like].fluid != fluid:
        return []
    return [
        FluidDriver(name, f"{module}.{s.name}", fluid, _unit_of(plant, name))
        for s in there.type.signals.values()
        if s.unit.dimension == TEMPERATURE and s.quantity in units.interval
    ]


def thermometer(knowledge: Knowledge) -> str:
    """The quantity on which properties of a fluid depend."""
    units = knowledge.units
    return next((q for q in sorted(units.interval) if units.quantities[q] == TEMPERATURE), "")


def _unit_of(plant: Plant, quantity: str) -> Unit:
    """The unit in which the plant reads a quantity, else a usual one."""
    units = plant.knowledge.units
    dimension = units.quantities[quantity]
    signals = (s for m in plant.modules.values() for s in m.type.signals.values())
    own = (s.unit for s in signals if s.quantity == quantity)
    named = (u for u in units.units.values() if u.dimension == dimension)
    return next(own, None) or next(named, units.plain(dimension))
