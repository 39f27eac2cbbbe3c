"""Degrees at which the faults of a group are isolated, and the cheapest sensors to isolate them.

Each group is judged only by the estimates around its modules, so that the effort is proportional to
the number of modules.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.module_type import Signal
from rulec.knowledge.plant import Module
from rulec.language.units import VOLUME_FLOW
from rulec.limits import SEPARATED
from rulec.passes.assemble import Assembly
from rulec.passes.derive_signatures import Signatures
from rulec.passes.limits import (
    FAR_READERS,
    LEAST_SPREAD,
    SEEN,
    SMALL_DEGREE,
    WIDE_JUNCTION,
)
from rulec.passes.link import Network
from rulec.passes.neighbourhood import READING, Linearised, Neighbourhood, Sensor, apart, linearise


class Adviser:
    """Judges groups of faults of one plant; shared results are calculated once."""

    def __init__(self, network: Network, assembly: Assembly, signatures: Signatures) -> None:
        self._modules = network.plant.modules
        self._knowledge = network.plant.knowledge
        measured = [m.name for m in self._modules.values() if m.type.observers]
        self._balances = network.graph.measured_balances(measured)
        self._nodes: dict[str, frozenset[int]] = {name: frozenset() for name in self._modules}
        for node, names in self._balances.items():
            for name in names:
                self._nodes[name] |= {node}
        self._number = {name: i for i, name in enumerate(self._modules)}
        self._linear = linearise(network, assembly, signatures)
        self._faults: dict[str, list[str]] = {}
        self._module_of: dict[str, str] = {}
        self._variants = {h.id: h.fault.variant for h in assembly.hypotheses}
        self._wrong = {
            h.id: f"{h.module}.{h.fault.target}"
            for h in assembly.hypotheses
            if h.fault.fault.acts_on == "signal"
        }
        self._reached: dict[str, set[str]] = {}
        for h in assembly.hypotheses:
            self._faults.setdefault(h.module, []).append(h.id)
            self._module_of[h.id] = h.module
            reached = self._reached.setdefault(h.module, set())
            reached.update(o.partition(".")[0] for o in h.affects)
        self._around = {name: self._surrounding(name) for name in self._modules}
        self._hoods: dict[frozenset[int | str], Neighbourhood] = {}

    def degrees(self, faults: Sequence[str]) -> tuple[float, ...]:
        """Smallest degree, as a share, that isolates each fault from all others; inf if none of its
        range does.

        Empty if no junction joins the modules of the group.
        """
        hood = self._hood(faults)
        each = () if hood is None else degrees_at(apart(hood.gram(faults)))
        highest = self._highest(faults)
        return tuple(x if x <= most else np.inf for x, most in zip(each, highest, strict=False))

    def _highest(self, faults: Sequence[str]) -> list[float]:
        """The ends of the ranges of faults, as shares."""
        return [self._variants[f].highest / self._variants[f].scale for f in faults]

    def close_pairs(self) -> Iterable[tuple[str, str]]:
        """Pairs within or beside a module that a small degree detects but does not isolate."""
        for key in dict.fromkeys(self._key(pair) for pair in self._neighbours()):
            hood = self._hood_of(key)
            for faults in self._together(key, hood):
                distance = SMALL_DEGREE * apart(hood.gram(faults))
                detected = np.diagonal(distance) >= SEPARATED
                masked = (distance < SEPARATED) & detected[:, None]
                for i, j in np.argwhere(np.triu(masked | masked.T, 1)):
                    pair = (faults[i], faults[j])
                    if self._key([self._module_of[f] for f in pair]) == key:
                        yield pair

    def unit(self, fault: str) -> str:
        """The unit of a degree, to follow its number; empty for a share."""
        unit = self._variants[fault].unit
        return f" {unit}" if unit else ""

    def has(self, fault: str, degree: float) -> bool:
        """Whether a degree, in its unit, lies within the range of a fault."""
        return degree <= self._variants[fault].highest

    def in_unit(self, fault: str, share: float) -> float:
        """The degree of a fault that corresponds to a share."""
        return share * self._variants[fault].scale

    def size(self, fault: str, share: float) -> str:
        """The degree of a fault that corresponds to a share, as text."""
        return f"{self.in_unit(fault, share):.2g}{self.unit(fault)}"

    def sizes(self, faults: Sequence[str], share: float) -> str:
        """One degree for all faults, or one for each if some have a unit."""
        if not any(self.unit(fault) for fault in faults):
            return f"{share:.2g}"
        return " and ".join(f"{self.size(fault, share)} ({fault})" for fault in faults)

    def _together(self, key: frozenset[int | str], hood: Neighbourhood) -> list[list[str]]:
        """Groups of faults to be compared: all, but at a wide junction only those of one module."""
        if all(len(self._balances[p]) <= WIDE_JUNCTION for p in key if isinstance(p, int)):
            return [list(hood.faults)]
        modules = dict.fromkeys(self._module_of[f] for f in hood.faults)
        return [self._faults[m] for m in modules if self._around[m] == key]

    def of_one_reading(self, faults: Sequence[str]) -> list[list[str]]:
        """Groups of errors of one reading: only several operating points can isolate them."""
        groups: dict[str, list[str]] = {}
        for fault in faults:
            groups.setdefault(self._wrong.get(fault, fault), []).append(fault)
        return list(groups.values())

    def advise(self, faults: Sequence[str]) -> tuple[tuple[Sensor, ...], float] | None:
        """The cheapest sensors, two at most, that isolate the faults of a group, and the degree
        that they need; no sensor if the plant already does so."""
        hood = self._hood(faults)
        if hood is None or len(faults) == 1:
            return None
        modules = dict.fromkeys(self._module_of[f] for f in faults)
        own = (candidates(self._modules[m], self._knowledge, self._linear) for m in modules)
        sensors = [sensor for some in own for sensor in some]
        return cheapest(hood, faults, sensors, self._highest(faults))

    def _neighbours(self) -> Iterable[tuple[str, ...]]:
        """Each module, and each pair of modules that meet at a junction."""
        for name in self._modules:
            yield (name,)
        for names in self._balances.values():
            if len(names) <= WIDE_JUNCTION:
                yield from itertools.combinations(names, 2)

    def _surrounding(self, name: str) -> frozenset[int | str]:
        """Places of a module, by number, and modules that are added by name.

        The latter are the module itself, if it is at no node, and some that read its signals.
        """
        nodes, number = self._nodes[name], self._number
        far = [m for m in self._reached.get(name, ()) if not self._nodes[m] & nodes]
        near = sorted(far, key=lambda m: (abs(number[m] - number[name]), m))
        alone = {name} if not nodes else set()
        return frozenset((*nodes, *alone, *near[:FAR_READERS]))

    def _key(self, modules: Iterable[str]) -> frozenset[int | str]:
        return frozenset().union(*(self._around[name] for name in modules))

    def _hood(self, faults: Sequence[str]) -> Neighbourhood | None:
        modules = list(dict.fromkeys(self._module_of[f] for f in faults))
        shared = [self._nodes[a] & self._nodes[b] for a, b in itertools.combinations(modules, 2)]
        return self._hood_of(self._key(modules)) if all(shared) else None

    def _hood_of(self, key: frozenset[int | str]) -> Neighbourhood:
        """Balances of the first observers, and each against the others of its module."""
        if key in self._hoods:
            return self._hoods[key]
        nodes = sorted(p for p in key if isinstance(p, int))
        balances = [self._balances[p] for p in nodes]
        names = {n for b in balances for n in b} | {p for p in key if isinstance(p, str)}
        modules = [m for name, m in self._modules.items() if name in names]
        residuals = [
            {f"{n}.{next(iter(self._modules[n].type.observers))}": s for n, s in b.items()}
            for b in balances
        ]
        for module in modules:
            first, *others = (f"{module.name}.{o}" for o in module.type.observers or ("",))
            residuals += [{first: 1, other: -1} for other in others]
        faults = [f for m in modules for f in self._faults.get(m.name, ())]
        self._hoods[key] = Neighbourhood.of(self._linear, residuals, faults)
        return self._hoods[key]


# Sensors that could be added to a module, and the cheapest that isolate faults from each other.
#
# A sensor adds one comparison. Its effects and covariance follow from the tables of `linearise`, so
# nothing is compiled again.


def candidates(module: Module, knowledge: Knowledge, tables: Linearised) -> Iterable[Sensor]:
    """A second reading of each own signal that an estimate uses, and a flow meter."""
    observers = [f"{module.name}.{o}" for o in module.type.observers]
    inputs = {name for observer in observers for name in tables.gradients[observer]}
    used = [s for s in module.type.signals.values() if f"{module.name}.{s.name}" in inputs]
    for signal in used:
        reading = f"{module.name}.{signal.name}"
        yield Sensor(
            module=module.name,
            signal=signal.name,
            title=f"a second reading of {reading}",
            cost=knowledge.sensors[signal.sensor].cost,
            existing=f"{READING}{reading}",
            u=tables.gradients[f"{READING}{reading}"][reading],
        )
    if observers and not any(_is_flow(signal) for signal in used):
        yield from _flow_meter(module, knowledge, observers[0], tables.flows[observers[0]])


def _flow_meter(
    module: Module, knowledge: Knowledge, estimate: str, flow: float
) -> Iterable[Sensor]:
    """The cheapest flow meter that the type declares but no estimate uses, else that fits."""
    classes, quantities = knowledge.sensors, knowledge.units.quantities
    declared = [
        (classes[s.sensor], s.name, s.full_scale)
        for s in module.type.signals.values()
        if _is_flow(s)
    ]
    fitting = [
        (c, c.measures, None)
        for c in classes.values()
        if quantities.get(c.measures) == VOLUME_FLOW and c.kind != "full scale"
    ]
    for sensor, name, full_scale in sorted(declared or fitting, key=lambda k: k[0].cost)[:1]:
        yield Sensor(
            module=module.name,
            signal=name,
            title=f"a flow meter in {module.name}",
            cost=sensor.cost,
            existing=estimate,
            u=sensor.uncertainty(full_scale, flow),
        )


def _is_flow(signal: Signal) -> bool:
    return signal.unit.dimension == VOLUME_FLOW


def degrees_at(distance: Array) -> tuple[float, ...]:
    """Per fault the smallest degree, as a share, that isolates it from all others.

    `distance` holds distances per unit of degree, shape (faults, faults), as given by `apart`; inf
    if no degree isolates a fault.
    """
    with np.errstate(divide="ignore"):
        worst = SEPARATED / distance.min(axis=-1)
    return tuple(worst.tolist())


def cheapest(
    hood: Neighbourhood, faults: Sequence[str], sensors: Sequence[Sensor], highest: Sequence[float]
) -> tuple[tuple[Sensor, ...], float] | None:
    """The cheapest sensors, two at most, that isolate all faults at degrees up to the `highest`,
    and the smallest degree that they need; no sensor where the plant already does so and none
    leads to a small degree."""
    gram = hood.gram(faults)
    effects, covariance = hood.added(faults, sensors)
    covariance = covariance + LEAST_SPREAD * np.eye(len(sensors))

    def among(chosen: tuple[int, ...]) -> Array:
        """Distances of the faults with some of the sensors added, as given by `apart`."""
        part = effects[:, chosen]
        if len(chosen) == 1:
            weighed = part / covariance[chosen[0], chosen[0]]
        else:
            weighed = part @ np.linalg.inv(covariance[np.ix_(chosen, chosen)])
        return apart(gram + weighed @ part.T)

    def cost(chosen: tuple[int, ...]) -> float:
        return sum(sensors[i].cost for i in chosen)

    def needed(chosen: tuple[int, ...], soon: bool) -> float:
        """The degree that isolates all faults with some of the sensors added; inf if it is beyond
        the range of one, or not small. With `soon` it may be large if it is soon after detection.
        """
        distance = among(chosen)
        each = degrees_at(distance)
        enough = max(each) <= SMALL_DEGREE or (soon and _is_isolated(distance))
        return max(each) if enough and np.all(np.less_equal(each, highest)) else np.inf

    without = needed((), soon=True)
    numbers = range(len(sensors))
    choices = [c for k in (1, 2) for c in itertools.combinations(numbers, k)]
    for _, same in itertools.groupby(sorted(choices, key=cost), key=cost):
        degree, chosen = min((needed(c, soon=without == np.inf), c) for c in same)
        if degree < np.inf:
            return tuple(sensors[i] for i in chosen), degree
    return None if without == np.inf else ((), without)


def _is_isolated(distance: Array) -> bool:
    """Whether each fault is isolated at a small degree, or almost as soon as it is detected."""
    enough = np.minimum(SMALL_DEGREE * np.diagonal(distance) / SEEN, SEPARATED)
    return bool(np.all(SMALL_DEGREE * distance.min(axis=-1) >= enough))
