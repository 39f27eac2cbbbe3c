"""The equations of a plant as its ruleset holds them: what its readings and flows must obey.

Each observer, its faults undone, gives the flow of its module; flows balance at junctions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

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
        """Size of each predicted reading, SI: what its sensor shows at the reference point."""
        shown = [s.reference - s.offset for s in self.predicted_signals]
        signals = zip(shown, self.predicted_signals, strict=True)
        return np.array([abs(size) or s.full_scale or 1.0 for size, s in signals])

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
        modules = [self.flows.index(o.module) for o in self.ruleset.observers]
        return np.array(modules, dtype=int)

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
        groups = {i: g for g, members in enumerate(self.groups) for i in members}
        return np.array([groups[i] for i in range(len(self.predicted))], dtype=int)
