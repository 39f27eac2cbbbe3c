"""How far apart the faults of a group are, and the cheapest sensors that would tell them apart.

Candidates are, in the modules of the group, a second reading of every signal that an estimate
uses, and a flow meter. What a candidate adds is one more comparison; its effects and covariance
follow from the tables of `linearise`, so nothing is compiled again.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rulec.derive_signatures import Signatures
from rulec.knowledge import Signal
from rulec.language.units import VOLUME_FLOW
from rulec.linearise import linearise
from rulec.neighbourhood import NO_SPREAD, Neighbourhood, Sensor, apart
from rulec.plant import Module
from runtime.plan import Array

SEPARATED = 4.0
"""Standard deviations that tell two faults apart: two bounds of Table 1, each twice its u."""

SMALL = 0.2
"""A degree at which faults should be told apart; beyond it they count as alike in practice."""

SEEN = 2.0
"""Advice may leave a fault that is hard to see at this multiple of the degree that shows it."""

WIDE = 30
"""At junctions of more modules than this, pairs of faults of different modules are not listed:
their number grows with the square."""

REACH = 6
"""Of modules further away that read a signal of a module, so many nearest ones are looked at."""

MOST = 4
"""No advice asks for more sensors than this."""


@dataclass(frozen=True)
class Advice:
    """Sensors that together tell a group apart, and the degree from which on they do."""

    sensors: tuple[Sensor, ...]
    degree: float


class Adviser:
    """Judges groups of faults of one plant; what modules share is worked out once."""

    def __init__(self, signatures: Signatures) -> None:
        self._signatures = signatures
        network = signatures.assembly.residuals.network
        self._modules = network.plant.modules
        self._knowledge = network.plant.knowledge
        measured = [m.name for m in self._modules.values() if m.type.observers]
        self._balances = network.graph.measured_balances(measured)
        self._places: dict[str, frozenset[int]] = {name: frozenset() for name in self._modules}
        for place, names in self._balances.items():
            for name in names:
                self._places[name] |= {place}
        self._number = {name: i for i, name in enumerate(self._modules)}
        self._linear = linearise(signatures)
        self._faults: dict[str, list[str]] = {}
        self._module_of: dict[str, str] = {}
        self._reached: dict[str, set[str]] = {}
        for h in signatures.assembly.hypotheses:
            self._faults.setdefault(h.module, []).append(h.id)
            self._module_of[h.id] = h.module
            reached = self._reached.setdefault(h.module, set())
            reached.update(o.partition(".")[0] for o in h.affects)
        self._around = {name: self._surrounding(name) for name in self._modules}
        self._hoods: dict[frozenset[int | str], Neighbourhood] = {}
        self._candidates: dict[str, tuple[Sensor, ...]] = {}

    def degrees(self, faults: Sequence[str]) -> tuple[float, ...]:
        """Degree from which on each fault is told from all others of the group; inf if never.

        Empty where no junction joins the modules of the group.
        """
        hood = self._hood(faults)
        return () if hood is None else _degrees(hood.gram(faults))

    def alike(self) -> Iterable[tuple[str, str]]:
        """Pairs that at a small degree are seen, but not told apart, within or beside a module."""
        keys = dict.fromkeys(self._key(pair) for pair in self._neighbours())
        for key in keys:
            hood = self._hood_of(key)
            for faults in self._together(key, hood):
                distance = SMALL * apart(hood.gram(faults))
                seen = np.diagonal(distance) >= SEPARATED
                hidden = (distance < SEPARATED) & seen[:, None]
                for i, j in np.argwhere(np.triu(hidden | hidden.T, 1)):
                    pair = (faults[i], faults[j])
                    if self._key([self._module_of[f] for f in pair]) == key:
                        yield pair

    def _together(self, key: frozenset[int | str], hood: Neighbourhood) -> list[list[str]]:
        """Faults whose pairs are looked at: all, but at a wide junction those of one module."""
        if all(len(self._balances[p]) <= WIDE for p in key if isinstance(p, int)):
            return [list(hood.faults)]
        modules = dict.fromkeys(self._module_of[f] for f in hood.faults)
        return [self._faults[m] for m in modules if self._around[m] == key]

    def advise(self, faults: Sequence[str]) -> Advice | None:
        """The cheapest one or two sensors that tell a group apart, else a greedy choice of more."""
        hood = self._hood(faults)
        if hood is None:
            return None
        modules = dict.fromkeys(self._module_of[f] for f in faults)
        sensors = [s for name in modules for s in self._sensors(name)]
        return _cheapest(hood, faults, sensors)

    def _neighbours(self) -> Iterable[tuple[str, ...]]:
        """Each module, and each two modules that meet at a junction."""
        for name in self._modules:
            yield (name,)
        for names in self._balances.values():
            if len(names) <= WIDE:
                yield from itertools.combinations(names, 2)

    def _surrounding(self, name: str) -> frozenset[int | str]:
        """Places of a module, by number, and modules that stand for themselves, by name.

        The latter are the module, if it touches no place, and some that read its signals.
        """
        places = self._places[name]
        number = self._number
        far = [m for m in self._reached.get(name, ()) if not self._places[m] & places]
        near = sorted(far, key=lambda m: (abs(number[m] - number[name]), m))
        alone = {name} if not places else set()
        return frozenset((*places, *alone, *near[:REACH]))

    def _key(self, modules: Iterable[str]) -> frozenset[int | str]:
        return frozenset().union(*(self._around[name] for name in modules))

    def _hood(self, faults: Sequence[str]) -> Neighbourhood | None:
        modules = list(dict.fromkeys(self._module_of[f] for f in faults))
        shared = [self._places[a] & self._places[b] for a, b in itertools.combinations(modules, 2)]
        return self._hood_of(self._key(modules)) if all(shared) else None

    def _hood_of(self, key: frozenset[int | str]) -> Neighbourhood:
        if key not in self._hoods:
            self._hoods[key] = self._neighbourhood(key)
        return self._hoods[key]

    def _neighbourhood(self, key: frozenset[int | str]) -> Neighbourhood:
        """First observers in the balances, and against them the others of each module."""
        places = sorted(p for p in key if isinstance(p, int))
        balances = [self._balances[p] for p in places]
        names = {n for b in balances for n in b} | {p for p in key if isinstance(p, str)}
        modules = [m for name, m in self._modules.items() if name in names]
        residuals = [{f"{n}.{_first(self._modules[n])}": s for n, s in b.items()} for b in balances]
        for module in modules:
            first, *others = (f"{module.name}.{o}" for o in module.type.observers or ("",))
            residuals += [{first: 1, other: -1} for other in others]
        faults = [f for m in modules for f in self._faults.get(m.name, ())]
        return Neighbourhood.of(self._linear, residuals, faults)

    def _sensors(self, name: str) -> tuple[Sensor, ...]:
        if name not in self._candidates:
            module = self._modules[name]
            found = (*self._second_readings(module), *self._flow_meter(module))
            self._candidates[name] = found
        return self._candidates[name]

    def _used(self, module: Module) -> list[Signal]:
        """Own signals that an estimate of the module reads."""
        inputs = {n for o in module.type.observers for n in self._linear.gradients[_id(module, o)]}
        return [s for s in module.type.signals.values() if _id(module, s.name) in inputs]

    def _second_readings(self, module: Module) -> Iterable[Sensor]:
        for signal in self._used(module):
            reading = _id(module, signal.name)
            cost = self._knowledge.sensors[signal.sensor].cost
            title, u = f"a second reading of {reading}", self._linear.uncertainties[reading]
            yield Sensor(module.name, signal.name, title, cost, reading, u)

    def _flow_meter(self, module: Module) -> Iterable[Sensor]:
        """As declared but not used by the type, else of the cheapest class that needs no range."""
        if not module.type.observers or any(_is_flow(s) for s in self._used(module)):
            return
        classes = self._knowledge.sensors
        kinds = self._knowledge.units.quantities
        declared = [
            (classes[s.sensor], s.name, s.full_scale)
            for s in module.type.signals.values()
            if _is_flow(s)
        ]
        known = [
            (c, c.measures, None)
            for c in classes.values()
            if kinds.get(c.measures) == VOLUME_FLOW and c.kind != "full scale"
        ]
        for sensor, name, full_scale in sorted(declared or known, key=lambda k: k[0].cost)[:1]:
            existing = _id(module, _first(module))
            u = sensor.uncertainty(full_scale, self._signatures.flows[existing])
            title = f"a flow meter in {module.name}"
            yield Sensor(module.name, name, title, sensor.cost, existing, u)


def _id(module: Module, name: str) -> str:
    return f"{module.name}.{name}"


def _first(module: Module) -> str:
    return next(iter(module.type.observers))


def _is_flow(signal: Signal) -> bool:
    return signal.unit.dimension == VOLUME_FLOW


def _degrees(gram: Array) -> tuple[float, ...]:
    """Per fault the degree from which on it is told from every other one."""
    distance = apart(gram)
    with np.errstate(divide="ignore"):
        worst = SEPARATED / distance.min(axis=-1)
    return tuple(float(x) for x in worst)


def _cheapest(
    hood: Neighbourhood, faults: Sequence[str], sensors: Sequence[Sensor]
) -> Advice | None:
    gram = hood.gram(faults)
    effects, covariance = hood.added(faults, sensors)

    def with_(chosen: tuple[int, ...]) -> Array:
        """Products of effects with some of the sensors added."""
        part = effects[:, chosen]
        own = covariance[np.ix_(chosen, chosen)]
        inverse = np.linalg.inv(own + NO_SPREAD * np.eye(len(chosen)))
        more: Array = gram + part @ inverse @ part.T
        return more

    def cost(chosen: tuple[int, ...]) -> float:
        return sum(sensors[i].cost for i in chosen)

    numbers = range(len(sensors))
    choices = [c for k in (1, 2) for c in itertools.combinations(numbers, k)]
    for _, same in itertools.groupby(sorted(choices, key=cost), key=cost):
        told = [(max(_degrees(with_(c))), c) for c in same if _is_told(with_(c))]
        if told:
            degree, chosen = min(told)
            return Advice(tuple(sensors[i] for i in chosen), degree)
    chosen = ()
    while len(chosen) < min(MOST, len(sensors)):
        more = [(*chosen, i) for i in numbers if i not in chosen]
        chosen = min(more, key=lambda c: (_degrees_left(with_(c)), cost(c)))
        if _is_told(with_(chosen)):
            return Advice(tuple(sensors[i] for i in chosen), max(_degrees(with_(chosen))))
    return None


def _degrees_left(gram: Array) -> tuple[int, float]:
    """How many faults are told at no degree, and the largest degree of the others."""
    degrees = np.array(_degrees(gram))
    never = np.isinf(degrees)
    return int(never.sum()), float(degrees[~never].max(initial=0.0))


def _is_told(gram: Array) -> bool:
    """Is every fault told from the others at a small degree, or nearly as soon as it is seen?"""
    distance = apart(gram)
    enough = np.minimum(SMALL * np.diagonal(distance) / SEEN, SEPARATED)
    return bool(np.all(SMALL * distance.min(axis=-1) >= enough))
