"""The equations of a plant as its ruleset holds them: what its readings and flows must obey.

Each observer, its faults undone, gives the flow of its module; flows balance at junctions.
Unknown are readings that are not inputs and the flows of modules. Where there are more unknowns
than equations, some readings are given instead: flows count as unknown first, then readings in
order of how few observers read them. So what one observer alone reads is predicted, and what
several laws depend on (a temperature, say) drives them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from runtime.matching import match, surplus
from runtime.plan import Array, Plan
from runtime.ruleset import Ruleset, SignalSpec

Numbers = NDArray[np.intp]


class SimulationRefused(Exception):
    """The plant cannot be simulated as asked; the message is for the user."""


@dataclass(frozen=True)
class Equations:
    """As many independent equations as unknowns.

    Attributes
    ----------
    predicted, given : ids of signals; all that some observer reads are in either.
    flows : modules whose flow is unknown: those with observers.
    balances : shape (independent balances, flows).
    """

    ruleset: Ruleset
    predicted: tuple[str, ...]
    given: tuple[str, ...]
    flows: tuple[str, ...]
    balances: Array

    @cached_property
    def plan(self) -> Plan:
        """The observers with faults undone, and nothing else."""
        return self.ruleset.undo.select([f"q:{o.id}" for o in self.ruleset.observers])

    @cached_property
    def scales(self) -> Array:
        """Size of each predicted reading, SI: its value at the reference point."""
        signals = self.predicted_signals
        return np.array([abs(s.reference) or s.full_scale or 1.0 for s in signals])

    @cached_property
    def start(self) -> Array:
        """The reference point: readings, then flows, in units of their scales."""
        readings = np.array([s.reference for s in self.predicted_signals]) / self.scales
        return np.concatenate([readings, np.ones(len(self.flows))])

    @cached_property
    def flow_scales(self) -> Array:
        """Size of each flow, m3/s: the mean of its estimates at the reference point."""
        sizes: dict[str, list[float]] = {name: [] for name in self.flows}
        for observer in self.ruleset.observers:
            sizes[observer.module].append(abs(observer.reference))
        means = np.array([np.mean(s) for s in sizes.values()])
        return np.where(means > 0, means, np.max(means, initial=0.0) or 1.0)

    @cached_property
    def scaled_balances(self) -> Array:
        """The balances of flows in units of their scales."""
        scaled: Array = self.balances * self.flow_scales / self.flow_scales.max()
        return scaled

    @cached_property
    def predicted_signals(self) -> tuple[SignalSpec, ...]:
        return tuple(self.ruleset.signal_by_id[name] for name in self.predicted)

    @cached_property
    def given_signals(self) -> tuple[SignalSpec, ...]:
        return tuple(self.ruleset.signal_by_id[name] for name in self.given)

    @cached_property
    def module_of(self) -> Numbers:
        """Number of each observer's module among `flows`."""
        return np.array([self.flows.index(o.module) for o in self.ruleset.observers])

    @cached_property
    def dependencies(self) -> tuple[Numbers, Numbers]:
        """Which observer reads which predicted reading, as two lists of numbers."""
        number = {name: i for i, name in enumerate(self.predicted)}
        pairs = [
            (i, number[name])
            for i, observer in enumerate(self.ruleset.observers)
            for name in observer.signals
            if name in number
        ]
        observer, reading = np.array(pairs, dtype=int).reshape(-1, 2).T
        return observer, reading

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Predicted readings by number; no observer reads two of a group.

        Their derivatives are found together (Curtis, Powell and Reid 1974).
        """
        readers: list[set[int]] = [set() for _ in self.predicted]
        for observer, reading in zip(*self.dependencies, strict=True):
            readers[reading].add(int(observer))
        groups: list[tuple[list[int], set[int]]] = []
        for i, own in enumerate(readers):
            fitting = (group for group in groups if not group[1] & own)
            members, taken = next(fitting, ([], set()))
            if not members:
                groups.append((members, taken))
            members.append(i)
            taken |= own
        return tuple(tuple(members) for members, _ in groups)

    @cached_property
    def group_of(self) -> Numbers:
        """Group of each predicted reading."""
        return np.array(
            [g for i in range(len(self.predicted)) for g, m in enumerate(self.groups) if i in m]
        )


def equations_of(ruleset: Ruleset) -> Equations:
    """Find what is unknown, and what has to be given.

    Raises
    ------
    SimulationRefused
        Some observers over-determine their readings: a healthy plant obeys them only by chance.
    """
    flows = tuple(m for m in ruleset.modules if any(o.module == m for o in ruleset.observers))
    balances = _balances_between(ruleset, flows)
    candidates = _candidates(ruleset)
    rows = len(ruleset.observers)
    readers = [
        [i for i, o in enumerate(ruleset.observers) if o.module == name]
        + [rows + i for i in np.flatnonzero(balances[:, j]).tolist()]
        for j, name in enumerate(flows)
    ]
    readers += [
        [i for i, o in enumerate(ruleset.observers) if s.id in o.signals] for s in candidates
    ]
    partner = match(readers)
    many, unknowns = surplus(readers, partner, rows + len(balances))
    names = [*flows, *(s.id for s in candidates)]
    if many:
        raise SimulationRefused(
            _over_determined(ruleset, [i for i in many if i < rows], [names[i] for i in unknowns])
        )
    free = {names[i] for i, equation in enumerate(partner) if equation is None}
    used = {s for o in ruleset.observers for s in o.signals}
    unknown = {s.id for s in candidates} - free
    return Equations(
        ruleset,
        tuple(s.id for s in ruleset.signals if s.id in unknown),
        tuple(s.id for s in ruleset.signals if s.id in used - unknown),
        flows,
        balances,
    )


def _candidates(ruleset: Ruleset) -> list[SignalSpec]:
    """Readings that may be predicted; those that few observers read come first."""
    count = {s.id: sum(s.id in o.signals for o in ruleset.observers) for s in ruleset.signals}
    found = [s for s in ruleset.signals if count[s.id] and not s.is_input]
    return sorted(found, key=lambda s: count[s.id])


def _over_determined(ruleset: Ruleset, observers: Sequence[int], unknowns: Sequence[str]) -> str:
    names = ", ".join(ruleset.observers[i].id for i in observers) or "the junctions"
    readings = [name for name in unknowns if name in ruleset.signal_by_id]
    of = f"only {', '.join(readings)} and the flows" if readings else "only the flows"
    return (
        f"{ruleset.plant} cannot be simulated: {names} and the junctions between them are more "
        f"equations than unknowns ({of} are free to follow). An observer too many needs a reading "
        "of its own, which is not 'input: true'"
    )


def _balances_between(ruleset: Ruleset, flows: Sequence[str]) -> Array:
    """Independent balances among the modules in `flows`; flows of all others are eliminated."""
    others = [m for m in ruleset.modules if m not in flows]
    column = {name: i for i, name in enumerate([*others, *flows])}
    matrix = np.zeros((len(ruleset.junctions), len(column)))
    for row, junction in zip(matrix, ruleset.junctions, strict=True):
        for name in junction.outlets:
            row[column[name]] += 1.0
        for name in junction.inlets:
            row[column[name]] -= 1.0
    return _eliminated(matrix, len(others))[:, len(others) :]


def _eliminated(matrix: Array, first: int) -> Array:
    """Independent rows without entries in the first columns (Gauss, with pivoting)."""
    rest, done = matrix.copy(), 0
    kept = 0
    for j in range(matrix.shape[1]):
        if done == len(rest):
            break
        pivot = done + int(np.argmax(np.abs(rest[done:, j])))
        if abs(rest[pivot, j]) < 1e-9:
            continue
        rest[[done, pivot]] = rest[[pivot, done]]
        rest[done + 1 :] -= np.outer(rest[done + 1 :, j] / rest[done, j], rest[done])
        done += 1
        kept += j < first
    return rest[kept:done]
