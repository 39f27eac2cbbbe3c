"""The places of a module that a join fits, by their equations and never by name; and the readings
of the plant that can drive its law there."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import networkx as nx
import numpy as np
from rulec_runtime.contract.plan import Array, Plan

from rulec.algebra.tangent import run_with_slopes
from rulec.effects.candidate import TIME
from rulec.effects.limits import NEAREST_DRIVERS, STEEP
from rulec.effects.places import Site
from rulec.knowledge.effect import Driver, Effect, Join
from rulec.knowledge.fluid import property_at
from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.module_type import ENDS, INFLOW, Fluid
from rulec.knowledge.plant import Module, Plant
from rulec.language.units import TEMPERATURE, VOLUME_FLOW, Unit
from rulec.passes.link import Network
from rulec.passes.lower import lower_property

FLOW = "volume flow"
"""Quantity of the flows at the ends of a module that stores."""


def matching(join: Join, sites: Iterable[Site], knowledge: Knowledge, module: Module) -> list[Site]:
    """Places that a join fits; of those that depend on one another only the innermost."""
    if join.flows:
        return [s for s in sites if s.name == f"{join.flows}flow" and s.observers]
    if join.stores:
        return [s for s in sites if s.kind == "balance" and s.quantity == join.stores]
    if join.shows:
        return [s for s in sites if s.kind == "reading" and join.shows in ("any", s.quantity)]
    if join.reads:
        kind = module.type.signals
        signals = (s for s in sites if s.kind == "signal" and s.observers)
        return [s for s in signals if join.reads in ("any", kind[s.name].quantity)]
    wanted = knowledge.units.quantities[join.gives]
    fitting = [
        s
        for s in sites
        if s.kind in ("definition", "observer")
        and s.observers
        and (s.reads or s.name in ENDS)
        and s.dimension == wanted
        and s.measured == join.measured
        and not (s.kind == "observer" and module.type.observers[s.name].is_reference)
        # A flow that is subtracted from an estimate, such as leakage, is no relation of its own.
        and (s.dimension != VOLUME_FLOW or all(slope >= 0.0 for slope in s.moves.values()))
    ]
    inner = {s.name for s in fitting if s.kind == "definition"}
    return [
        s for s in fitting if not s.uses & (inner - {s.name} if s.kind != "observer" else inner)
    ]


class Binder:
    """Finds readings for drivers in one plant."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._pipes: nx.Graph = nx.Graph(network.plant.connections)

    def bindings(
        self, module: str, site: Site, effect: Effect, join: Join
    ) -> tuple[list[dict[str, str]], tuple[str, ...]]:
        """All choices of readings for the drivers of a law: own ones by name, others by id, or
        ``time``. Without any, the drivers that the plant would have to measure."""
        drivers = [effect.drivers[name] for name in drivers_of(join, effect)]
        options = {d.name: self._options(module, site, join, d) for d in drivers}
        chosen = itertools.product(*options.values())
        found = [dict(zip(options, signals, strict=True)) for signals in chosen]
        lacking = [d for d in drivers if not options[d.name]]
        helps = all(self._would_help(module, join, driver) for driver in lacking)
        return found, tuple(driver.name for driver in lacking) if helps else ()

    def _would_help(self, module: str, join: Join, driver: Driver) -> bool:
        """Would the law fit the place if this driver were measured?"""
        if _is_replaced(driver, join) or driver.name in (join.falls_with, join.rises_with):
            return False
        if driver.where == "downstream":
            behind = self._behind(module)
            return bool(behind) and not self._ids(behind, driver)
        if driver.where in ("unread", "beside"):
            # Nobody can say which further reading of that quantity this would be.
            return False
        return not self._own(module, driver)

    def _options(self, module: str, site: Site, join: Join, driver: Driver) -> list[str]:
        if driver.quantity == TIME:
            return [TIME]
        own = self._own(module, driver)
        if driver.name in (join.falls_with, join.rises_with):
            sign = -1.0 if driver.name == join.falls_with else 1.0
            following = [s for s in own if site.slopes.get(s, 0.0) * sign > 0.0]
            # If a join names both directions, its steepness is that of the fall.
            if join.steep is None or (join.falls_with and driver.name != join.falls_with):
                return following
            return [s for s in following if (abs(site.shares[s]) > STEEP) == join.steep]
        if _is_replaced(driver, join):
            return [s for s in own if s in site.reads]
        if driver.where == "downstream":
            return self._ids(self._behind(module), driver)
        if driver.where == "beside":
            signals = self._network.plant.modules[module].type.signals
            read = {signals[s].quantity for s in site.reads if s in signals}
            return [] if driver.quantity in read else own
        if driver.quantity == join.reads:
            # A threshold of the reading that is corrected.
            return [site.name]
        if driver.where == "plant" and not own:
            own = self._ids(self._nearest(module), driver)[:NEAREST_DRIVERS]
        derived = [d.local(module) for d in self._of_fluid(module, driver)]
        return [*(s for s in own if site.key != ("signal", s)), *derived]

    def _of_fluid(self, module: str, driver: Driver) -> list[FluidDriver]:
        """A property of the fluid in a module, at the thermometers that measure its temperature."""
        if driver.where not in ("own", "plant") or self._network.stores:
            return []
        others = self._nearest(module) if driver.where == "plant" else []
        found = drivers_at(self._network.plant, driver.quantity, module)
        for other in others if not found else ():
            found += drivers_at(self._network.plant, driver.quantity, other, like=module)
        return found[:NEAREST_DRIVERS]

    def _own(self, module: str, driver: Driver) -> list[str]:
        """Own states of a quantity, else signals, as a sensor shows what is stored."""
        kind = self._network.plant.modules[module].type
        signals = [s.name for s in kind.signals.values() if s.quantity == driver.quantity]
        if driver.where == "read":
            return [name for name in signals if name not in kind.readings]
        if driver.where == "unread":
            return [name for name in signals if name not in kind.read]
        if kind.flows and driver.quantity == FLOW:
            return [INFLOW]
        return [s.name for s in kind.states.values() if s.quantity == driver.quantity] or signals

    def _behind(self, module: str) -> list[str]:
        """Modules directly downstream."""
        return [b for a, b in self._network.plant.connections if a == module]

    def _ids(self, modules: Iterable[str], driver: Driver) -> list[str]:
        return [f"{m}.{s}" for m in modules for s in self._own(m, driver)]

    def _nearest(self, module: str) -> list[str]:
        """Other modules, nearest first, then in the order of the plant."""
        names, far = self._network.plant.modules, dict[str, int]()
        if module in self._pipes:
            far = nx.single_source_shortest_path_length(self._pipes, module)
        others = [name for name in names if name != module]
        return sorted(others, key=lambda name: far.get(name, len(names)))


def is_of_fluid(signals: Mapping[str, str]) -> bool:
    """Is some driver a property of the fluid instead of a reading?"""
    return any(property_at(source)[0] for source in signals.values())


def _is_replaced(driver: Driver, join: Join) -> bool:
    """Does the law of a join replace this driver in the plain law?"""
    return any(driver.name in replaced for replaced in join.law.substitutes.values())


def drivers_of(join: Join, effect: Effect) -> tuple[str, ...]:
    """Drivers in a law or its parameters, in the order of the effect."""
    needed = effect.needed_by(join)
    return tuple(name for name in effect.drivers if name in needed)


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
        finite = temperature[np.isfinite(temperature)]
        inside = (finite >= self.fluid.lowest) & (finite <= self.fluid.highest)
        return len(finite) > 0 and bool(inside.all())


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
