"""Modules with candidates built in, as plans for the analysis of a mismatch.

The builder knows all candidates of a plant. It makes a plan of any combination of them on demand
and caches it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from rulec_runtime.contract.plan import Plan
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.simulation.balances import Balances

from rulec.effects.binding import FluidDriver, drivers_at
from rulec.effects.candidate import (
    BaseParameters,
    Candidate,
    CurveTerm,
    DisturbanceLocation,
    Missing,
)
from rulec.effects.disturbance_locations import laws_of, locations_of, stores_of
from rulec.effects.equation_text import equation_of
from rulec.effects.free_form import BENDS, bent_line, curve_term, free_form
from rulec.effects.match_effects import Matched, Matches, match_effects
from rulec.knowledge.module_type import ENDS, Parameter
from rulec.knowledge.read import read_plant
from rulec.knowledge.sources import Sources
from rulec.passes.amend import Amended, amend
from rulec.passes.compile_cache import OpenedPlant
from rulec.passes.lower import Lowering, lower_module, lower_states, parameter_id
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation

SHOWN = "shown"


def open_builder(path: Path) -> tuple[Ruleset, ModelBuilder]:
    """Compile a plant, and make its builder; raises `Refused` with all mistakes in it."""
    sources = read_plant(path, effects=True)
    models = run_passes(Compilation(sources=sources))
    return models.ruleset, ModelBuilder(models, reference_readings(models, models.ruleset), sources)


def builder_of(plant: OpenedPlant) -> ModelBuilder:
    """The builder of a plant that is opened with effects; raises `Refused`."""
    readings = reference_readings(plant.models, plant.ruleset)
    return ModelBuilder(plant.models, readings, plant.sources)


def reference_readings(models: Compilation, ruleset: Ruleset) -> dict[str, float]:
    """Readings of all signals at the reference point, SI; guesses for signals without estimate."""
    read = {signal for observer in ruleset.observers for signal in observer.signals}
    solved = {s.id: s.reference for s in ruleset.signals if s.id in read}
    result = {}
    for module in models.plant.modules.values():
        for signal in module.type.signals.values():
            reading = module.reference.get(signal.name)
            if reading is None:
                reading = ((signal.lowest or 0.0) + (signal.highest or 2.0)) / 2
            name = f"{module.name}.{signal.name}"
            result[name] = solved.get(name, reading)
    return result


class ModelBuilder:
    """Builds modules of one plant with candidates in them, in the order of their acceptance."""

    def __init__(
        self, models: Compilation, readings: Mapping[str, float], sources: Sources | None = None
    ) -> None:
        self._models, self._readings, self.sources = models, readings, sources
        self.network = models.network
        self._free: dict[str, Matched] = {}
        self._balances: dict[tuple[str, tuple[str, ...], tuple[str, ...]], Balances] = {}
        self._plans: dict[tuple[str, tuple[str, ...], tuple[str, ...], bool], Plan] = {}

    def connected(self, connections: tuple[tuple[str, str], ...]) -> tuple[Ruleset, ModelBuilder]:
        """The plant with other connections, compiled; raises `Refused` as for any plant.

        Module types do not depend on connections, so their symbolic work is not repeated.
        """
        sources = (self.sources or self._models.sources).connected(connections)
        plant = replace(self.network.plant, connections=connections, digest=sources.digest())
        models = run_passes(Compilation(sources=sources, plant=plant, types=self._models.types))
        readings = reference_readings(models, models.ruleset)
        return models.ruleset, ModelBuilder(models, readings, sources)

    @cached_property
    def matches(self) -> Matches:
        """Candidates and the places that they fit, of the whole plant."""
        return match_effects(self.network, self._readings)

    @cached_property
    def parameters(self) -> BaseParameters:
        """Uncertain parameters of all modules, with their joint covariance, and constants."""
        return _base_parameters(self._models)

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """Every explanation that fits some place, by module."""
        return tuple(m.candidate for m in self.matches.candidates)

    @cached_property
    def fluid_drivers(self) -> dict[str, FluidDriver]:
        """Properties of the fluid that may be drivers, by id."""
        plant = self.network.plant
        every = (
            driver
            for module in plant.modules.values()
            for name in (module.fluid.properties if module.fluid else ())
            for driver in drivers_at(plant, name, module.name)
        )
        return {driver.id: driver for driver in every}

    @property
    def missing(self) -> tuple[Missing, ...]:
        """Effects that lack a driver."""
        return self.matches.missing

    @cached_property
    def locations(self) -> tuple[DisturbanceLocation, ...]:
        """Disturbance locations of the whole plant."""
        around, sites = self.matches.around, self.matches.sites
        modules = self.network.plant.modules.values()
        settled = (s for m in modules for s in locations_of(around, m, sites[m.name]))
        stored = (s for m in modules for s in stores_of(around, m, sites[m.name]))
        return tuple({s.id: s for s in (*settled, *stored)}.values())

    @cached_property
    def laws(self) -> tuple[DisturbanceLocation, ...]:
        """Laws of the whole plant, each as a place with its accuracy."""
        around, sites = self.matches.around, self.matches.sites
        modules = self.network.plant.modules.values()
        return tuple(law for m in modules for law in laws_of(around, m, sites[m.name]))

    def plan(
        self,
        module: str,
        joined: tuple[str, ...],
        locations: tuple[str, ...] = (),
        definitions: bool = False,
    ) -> Plan:
        """The observers (and definitions) of a module with candidates and locations built in.

        Candidates and locations that affect no observer of the module are ignored.
        """
        joined = tuple(c for c in joined if self._reaches(self._of(c).candidate, module))
        locations = tuple(s for s in locations if self._reaches(self.location_by_id[s], module))
        key = module, joined, locations, definitions
        if key not in self._plans:
            owners = dict.fromkeys(m for c in joined for m in self._of(c).candidate.modules)
            amended = {owner: self.amended(owner, joined) for owner in owners}
            what = Lowering(self.network, amended, self._shifts(locations))
            self._plans[key] = lower_module(what, module, definitions)
        return self._plans[key]

    @cached_property
    def given(self) -> tuple[str, ...]:
        """Signals that no equation predicts: the inputs of a plant that stores."""
        modules = self.network.plant.modules.values()
        return tuple(
            f"{m.name}.{s}" for m in modules for s in m.type.signals if s not in m.type.readings
        )

    def balances(self, joined: tuple[str, ...], locations: tuple[str, ...] = ()) -> Balances:
        """The balances of the whole plant with candidates and locations built in.

        Outputs are sensor readings, as ``shown:<signal>``, and flows, as ``inflow:<module>`` and
        ``outflow:<module>``.
        """
        key = "", joined, locations
        if key not in self._balances:
            amended = {m: self.amended(m, joined) for m in self.network.plant.modules}
            what = Lowering(self.network, amended, self._shifts(locations), self.network.ends)
            plan = lower_states(what)
            states = tuple(
                f"{module}.{state}" for module, own in amended.items() for state in own.type.states
            )
            given = (*self.given, *(self.location_by_id[s].unknown for s in locations))
            used = tuple(name for name in given if name in plan.used_inputs)
            outputs = tuple(n for n in plan.outputs if n.partition(":")[0] in (SHOWN, *ENDS))
            self._balances[key] = Balances(plan, states, used, outputs)
        return self._balances[key]

    def amended(self, module: str, joined: Iterable[str]) -> Amended:
        """The type of a module with its candidates built in, in order."""
        result = Amended(type=self.network.plant.modules[module].type)
        changes = (self._of(name).change_of(module) for name in joined)
        own = [change for change in changes if change is not None]
        # Changes of the plain law come first, as added terms are not part of it.
        for change in sorted(own, key=lambda c: not c.substitutes):
            result = amend(result, change)
        return result

    def equation(self, module: str, joined: tuple[str, ...], place: str) -> str:
        """The equation of a place with candidates built in, in local names."""
        amended = self.amended(module, joined)
        kind = next(
            (k for c in joined for k, n in self._of(c).change.places if n == place), None
        ) or _kind_of(amended, place)
        return equation_of(amended, (kind, place))

    def free_form(self, location: str, bands: tuple[str, ...]) -> Candidate:
        """An additive curve at a location without physics behind it, in bands of a reading.

        The same call gives the same candidate.
        """
        id_ = f"{location}[{', '.join(bands)}]"
        if id_ not in self._free:
            self._free[id_] = free_form(self.location_by_id[location], id_, bands)
        return self._free[id_].candidate

    def bent_line(self, location: str, driver: str, knots: int) -> tuple[Candidate, ...]:
        """A piecewise linear curve over a driver at a location, with given knots.

        It comes in parts, as the length of an equation is limited. The same call gives the same
        candidates.
        """
        at, found = self.location_by_id[location], list[Candidate]()
        for first in range(0, knots, BENDS):
            bends = range(first, min(first + BENDS, knots))
            id_ = f"{location}[{driver}, bends {bends[0]} to {bends[-1]} of {knots}]"
            if id_ not in self._free:
                self._free[id_] = bent_line(at, id_, driver, bends, knots)
            found.append(self._free[id_].candidate)
        return tuple(found)

    def curve_term(self, curve: CurveTerm) -> Candidate:
        """The candidate that builds a curve in; a module type can hold it."""
        module, _, name = curve.driver.partition(".")
        plant = self.network.plant
        kind = plant.modules[module].type
        over = (kind.states.get(name) or kind.signals[name]).unit
        # The zero of a unit with an offset is not the zero of SI.
        over = plant.knowledge.units.plain(over.dimension) if over.offset else over
        self._free[curve.id] = curve_term(self.location_by_id[curve.place], curve, over)
        return self._free[curve.id].candidate

    def _shifts(self, locations: Iterable[str]) -> dict[tuple[str, str, str], str]:
        """Disturbance locations as shifts for `Lowering`."""
        own = (self.location_by_id[s] for s in locations)
        return {(p.module, p.kind, p.place): p.unknown for p in own}

    def _of(self, candidate: str) -> Matched:
        return self._free.get(candidate) or self._matched_by_id[candidate]

    @cached_property
    def _matched_by_id(self) -> dict[str, Matched]:
        return {m.candidate.id: m for m in self.matches.candidates}

    @cached_property
    def location_by_id(self) -> dict[str, DisturbanceLocation]:
        """Places at which an error may be built in, by id."""
        return {s.id: s for s in (*self.laws, *self.locations)}

    @staticmethod
    def _reaches(what: Candidate | DisturbanceLocation, module: str) -> bool:
        return any(o.split(".")[0] == module for o in what.observers)


def _kind_of(amended: Amended, place: str) -> str:
    if place in amended.type.definitions:
        return "definition"
    return "observer" if place in amended.type.observers else "signal"


def _base_parameters(models: Compilation) -> BaseParameters:
    """Uncertain parameters, correlated as their calibration says, and constants."""
    plant = models.plant
    constants: dict[str, float] = {}
    moved: dict[str, Parameter] = {}
    sheet: dict[str, tuple[float, float]] = {}
    for module in plant.modules.values():
        joint = {name for block in module.blocks for name in block.parameters}
        for name, parameter in module.parameters.items():
            if parameter.u or name in joint:
                stated = module.stated.get(name, parameter)
                moved[parameter_id(module, name)] = parameter
                sheet[parameter_id(module, name)] = stated.value, stated.u
            else:
                constants[parameter_id(module, name)] = parameter.value
    index = {name: i for i, name in enumerate(moved)}
    covariance = np.diag([p.u**2 for p in moved.values()])
    for module in plant.modules.values():
        for block in module.blocks:
            rows = [index[parameter_id(module, name)] for name in block.parameters]
            factor = np.array(block.factor)
            covariance[np.ix_(rows, rows)] = factor @ factor.T
    return BaseParameters(
        ids=tuple(moved),
        units=tuple(p.unit.text for p in moved.values()),
        factors=np.array([p.unit.factor for p in moved.values()]),
        values=np.array([p.value for p in moved.values()]),
        positive=np.array([p.positive for p in moved.values()], dtype=bool),
        lowest=np.array([p.lowest for p in moved.values()]),
        highest=np.array([p.highest for p in moved.values()]),
        covariance=covariance,
        constants=constants,
        sheet=sheet,
    )
