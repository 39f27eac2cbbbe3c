"""Disturbance locations: places where an error with an unknown course may act."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.algebra.tangent import run_with_slopes
from rulec.effects.candidate import DisturbanceLocation
from rulec.effects.limits import COMPARED_POINTS, COMPARED_WIDTH, PROPORTIONAL
from rulec.effects.places import Site, Survey
from rulec.knowledge.module_type import OUTFLOW
from rulec.knowledge.plant import Module, Plant
from rulec.language.units import NONE, TEMPERATURE, Dimension, Unit
from rulec.limits import ASSUMED_ACCURACY
from rulec.passes.lower import Lowering, lower_module

_RATE = Dimension.of({"s": -1})
_GIVEN = (NONE, TEMPERATURE, _RATE)
"""Dimensions of ratios, temperatures and speeds, which are given and which no relation explains."""


def locations_of(
    around: Survey, module: Module, sites: Iterable[Site]
) -> Iterator[DisturbanceLocation]:
    """Disturbance locations of a module; one for all places with the same effect."""
    for site in _distinct(around, module, _eligible(module, tuple(sites))):
        yield _location(around, module, site)


def _location(around: Survey, module: Module, site: Site) -> DisturbanceLocation:
    kind, name = site.key
    unit = unit_of(around.network.plant, module, site)
    per = ""
    if kind == "balance":
        unit, per = module.type.states[name].unit, "/s"
    id_ = f"{kind}:{module.name}.{name}"
    return DisturbanceLocation(
        id=id_,
        kind=kind,
        module=module.name,
        place=name,
        title=site.title,
        unit=f"{unit.text}{per}",
        factor=unit.factor,
        observers=site.observers,
        unknown=f"{id_}.error",
    )


def laws_of(around: Survey, module: Module, sites: Iterable[Site]) -> Iterator[DisturbanceLocation]:
    """Laws of a module, each with its accuracy; one may lie within a place of `locations_of`."""
    by_path = {(f"{site.kind}s", site.name): site for site in sites}
    for path, stated in module.type.laws().items():
        share = stated.share if stated else ASSUMED_ACCURACY
        yield replace(_location(around, module, by_path[path]), accuracy=share)


def stores_of(
    around: Survey, module: Module, sites: Iterable[Site]
) -> Iterator[DisturbanceLocation]:
    """Balances of a module that stores, the law of its outflow, and its sensors."""
    for site in sites:
        law = bool(module.type.states) and site.key == ("definition", OUTFLOW)
        if law or site.kind in ("balance", "reading"):
            yield _location(around, module, site)


def _eligible(module: Module, sites: tuple[Site, ...]) -> list[Site]:
    definitions = [
        s
        for s in sites
        if s.kind == "definition"
        and (s.reads or s.measured)
        and s.observers
        and s.dimension not in _GIVEN
    ]
    alone = {s.observers for s in definitions}
    # A definition represents an observer whose equation is just its name.
    names, own = {*module.type.definitions, *module.type.signals}, module.type.observers
    observers = [
        s
        for s in sites
        if s.kind == "observer"
        and not own[s.name].is_reference
        and s.observers not in alone
        and own[s.name].expression.text.strip() not in names
    ]
    signals = [s for s in sites if s.kind == "signal" and s.observers]
    # Of equivalent places the first is kept: an outer definition before those that it uses.
    return [*reversed(definitions), *observers, *signals]


def _distinct(around: Survey, module: Module, sites: list[Site]) -> list[Site]:
    """Leave out places whose error moves all observers in proportion to that of another place."""
    moves = _moves(around, module, sites)
    distinct: list[Site] = []
    for site in sites:
        alike = (s for s in distinct if s.observers == site.observers)
        if np.any(moves[site.key]) and not any(
            _proportional(moves[site.key], moves[s.key]) for s in alike
        ):
            distinct.append(site)
    definitions = [s for s in distinct if s.kind == "definition"]
    return [*reversed(definitions), *distinct[len(definitions) :]]


def _proportional(a: Array, b: Array) -> bool:
    product = float(np.sum(a * b)) ** 2
    return bool(product > PROPORTIONAL * float(np.sum(a * a)) * float(np.sum(b * b)))


def _moves(around: Survey, module: Module, sites: list[Site]) -> dict[tuple[str, str], Array]:
    """Slopes of all own observers by each place, at points around the reference. Readings of other
    modules stay at the reference; those that do not exist have no influence."""
    shifts = {(module.name, *s.key): "shift:{}:{}".format(*s.key) for s in sites}
    plan = lower_module(Lowering(around.network, {}, shifts), module.name)
    inputs: dict[str, Array | float] = {n: around.inputs.get(n, 0.0) for n in plan.inputs}
    for i, name in enumerate(f"{module.name}.{s}" for s in module.type.signals):
        if name in inputs:
            # Incommensurable steps: no two readings move alike.
            wave = np.sin((1.0 + i) * np.sqrt(2.0 + i) * np.arange(COMPARED_POINTS))
            inputs[name] = inputs[name] * (1.0 + COMPARED_WIDTH * wave)
    _, slopes = run_with_slopes(plan, inputs, list(shifts.values()))
    observers = [by for output, by in slopes.items() if output.startswith("q:")]
    found = {}
    for site, seed in zip(sites, shifts.values(), strict=True):
        rows = [by.get(seed, np.zeros(1)) for by in observers]
        moved = np.array([np.broadcast_to(row, (COMPARED_POINTS,)) for row in rows])
        found[site.key] = np.where(np.isfinite(moved), moved, 0.0)
    return found


def unit_of(plant: Plant, module: Module, site: Site) -> Unit:
    """A unit to show values of a place: that of a similar signal or parameter, own ones first."""
    shown = site.kind in ("signal", "reading")
    own = [module.type.signals[site.name].unit] if shown else []
    types = [module.type, *(m.type for m in plant.modules.values())]
    signals = (s.unit for kind in types for s in kind.signals.values())
    parameters = (p.unit for kind in types for p in kind.parameters.values())
    named = plant.knowledge.units.units.values()
    for unit in (*own, *signals, *parameters, *named):
        if unit.dimension == site.dimension:
            return unit
    return Unit(str(site.dimension), 1.0, site.dimension)
