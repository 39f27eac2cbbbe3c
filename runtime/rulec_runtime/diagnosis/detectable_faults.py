"""Which faults the readings of a plant can show, and which become undetectable without some.

The estimates, or balances, near the reference point of the ruleset decide, by the usual threshold.
A fault that the sheet's uncertainties hide at any degree counts as detectable while it leaves a
trace: recordings will lower these uncertainties.
"""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from math import comb, inf
from typing import Protocol

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec, ObserverSpec, Ruleset
from rulec_runtime.contract.threshold import threshold_of
from rulec_runtime.diagnosis.steady.chi_square import inverse_of
from rulec_runtime.diagnosis.steady.independent_parts import Part, parts_of
from rulec_runtime.diagnosis.steady.isolate import test_of
from rulec_runtime.diagnosis.steady.observe import observe_part
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.diagnosis.steady.redundancy import free_flows, vanishing
from rulec_runtime.recordings.stationary import systematic_u

NONE: frozenset[str] = frozenset()


class Sighted(Protocol):
    """A part of a plant that is judged on its own: the signals that it reads, and its faults."""

    @property
    def signals(self) -> frozenset[str]: ...

    @property
    def highest(self) -> Mapping[str, float]:
        """Faults with their largest degrees."""

    def information(self, lost: Set[str], still: Set[str] = NONE) -> Array:
        """Products of the effects of all faults with each other, shape (faults, faults), in the
        metric of errors, without lost signals and without the observers at standstill, by id; 0
        where a fault leaves no trace."""


@dataclass(frozen=True)
class PartSighted:
    """Estimates that check each other, at the reference point, and their reaction to some faults.

    `free` are the flows through their modules by those that are free, shape (observers, free);
    `covariance` is that of the estimates, (m3/s)^2; `slopes` are theirs by the degree of each
    fault, shape (observers, faults), m3/s.
    """

    observers: tuple[ObserverSpec, ...]
    faults: tuple[FaultSpec, ...]
    free: Array
    covariance: Array
    slopes: Array
    known: dict[bytes, Array] = field(default_factory=dict)

    @cached_property
    def signals(self) -> frozenset[str]:
        return frozenset(signal for o in self.observers for signal in o.signals)

    @cached_property
    def highest(self) -> Mapping[str, float]:
        return {f.id: f.highest for f in self.faults}

    def information(self, lost: Set[str], still: Set[str] = NONE) -> Array:
        there = [o.id not in still and lost.isdisjoint(o.signals) for o in self.observers]
        usable = np.array(there, dtype=bool)
        key = usable.tobytes()
        if key not in self.known:
            self.known[key] = self._information(usable)
        return self.known[key]

    def _information(self, usable: np.ndarray) -> Array:
        basis = vanishing(self.free[usable])
        own = self.slopes[usable]
        effects = basis @ own
        size, largest = np.linalg.norm(effects, axis=0), np.abs(own).max(axis=0, initial=0.0)
        effects = np.where(size > limits.UNTOUCHED * largest, effects, 0.0)
        if not len(basis):
            return np.zeros((len(self.faults), len(self.faults)))
        spread = basis @ self.covariance[np.ix_(usable, usable)] @ basis.T
        return np.asarray(effects.T @ inverse_of(spread[None])[0] @ effects)


@dataclass(frozen=True)
class Visible:
    """All parts of a plant."""

    parts: tuple[Sighted, ...]

    @cached_property
    def of_fault(self) -> Mapping[str, tuple[Sighted, ...]]:
        """The parts that may show each fault."""
        found: dict[str, list[Sighted]] = {}
        for one in self.parts:
            for fault in one.highest:
                found.setdefault(fault, []).append(one)
        return {fault: tuple(parts) for fault, parts in found.items()}

    def sees(self, fault: str, lost: Set[str] = NONE, still: Set[str] = NONE) -> bool:
        """Whether a fault is detectable without some signals, with some observers at standstill."""
        return any(_sees(one, fault, lost, still) for one in self.of_fault.get(fault, ()))

    def unseen(self, lost: Set[str], still: Set[str] = NONE) -> list[str]:
        """Faults that only lost signals hide."""
        touched = [one for one in self.parts if not lost.isdisjoint(one.signals)]
        asked = dict.fromkeys(fault for one in touched for fault in one.highest)
        return [f for f in asked if self.sees(f, NONE, still) and not self.sees(f, lost, still)]

    def brings_back(self, fault: str, lost: Set[str], still: Set[str] = NONE) -> tuple[str, ...]:
        """The smallest set of lost signals that makes a fault detectable again; those of its own
        module first. If there are too many sets to try, a set of which all are needed."""
        own = self.of_fault[fault]
        read = NONE.union(*(one.signals for one in own))
        module = fault.partition(".")[0]
        asked = sorted(lost & read, key=lambda s: (s.partition(".")[0] != module, s))

        def enough(back: Sequence[str]) -> bool:
            without = lost - set(back)
            return any(_sees(one, fault, without, still) for one in own)

        for size in range(1, len(asked) + 1):
            if comb(len(asked), size) > limits.SETS_TRIED:
                break
            for some in combinations(asked, size):
                if enough(some):
                    return some
        needed = list(asked)
        for signal in reversed(asked):
            fewer = [name for name in needed if name != signal]
            if enough(fewer):
                needed = fewer
        return tuple(needed)


def _sees(one: Sighted, fault: str, lost: Set[str], still: Set[str]) -> bool:
    """Whether a degree within the range of a fault is detectable, or any if its sheet hides all."""
    degree = _detectable(one, fault, lost & one.signals, still)
    sheet = _detectable(one, fault, NONE, NONE)
    return degree < (one.highest[fault] if sheet < one.highest[fault] else inf)


def _detectable(one: Sighted, fault: str, lost: Set[str], still: Set[str]) -> float:
    """Smallest detectable degree of a fault; infinite if it leaves no trace."""
    place = [*one.highest].index(fault)
    known = float(one.information(lost, still)[place, place])
    return threshold_of(known**-0.5) if known > 0.0 else inf


def visible_of(ruleset: Ruleset) -> Visible:
    """What the readings of a plant can show; worked out once for a ruleset."""
    if "visible" not in ruleset.kept:
        if ruleset.dynamics is None:
            ruleset.kept["visible"] = Visible(tuple(settled_parts(ruleset)))
        else:
            # The integrator takes a second to load, and only plants that store need it.
            from rulec_runtime.diagnosis.stores.detectable_faults import sighted

            ruleset.kept["visible"] = Visible((sighted(ruleset),))
    found: Visible = ruleset.kept["visible"]
    return found


def settled_parts(ruleset: Ruleset) -> list[PartSighted]:
    """The parts of a plant that settles, at its reference point. In a large one only the estimates
    nearest to its module decide whether a fault is detectable."""
    points, found = reference_point(ruleset), []
    for part in parts_of(ruleset):
        own = part.ruleset
        observed = observe_part(ruleset, part, points)
        valid = observed.valid[:, 0]
        slopes = np.zeros((len(own.observers), len(own.faults)))
        each = test_of(own, observed, valid, np.zeros((0, 0)), np.zeros(1, dtype=int)).each
        for column, (places, slope) in each.items():
            slopes[np.flatnonzero(valid)[places], column] = slope[:, 0, 0]
        groups: dict[str, list[int]] = {}
        for i, fault in enumerate(own.faults):
            whole = len(own.observers) <= limits.NEAREST_ESTIMATES
            groups.setdefault("" if whole else fault.module, []).append(i)
        covariance = observed.covariance_at(np.zeros(1, dtype=int))[0]
        place = {name: i for i, name in enumerate(ruleset.modules)}
        free = free_flows(ruleset)[[place[o.module] for o in own.observers]]
        for module, chosen in groups.items():
            near = np.flatnonzero(valid & _nearest(ruleset, part, module) if module else valid)
            found.append(
                PartSighted(
                    observers=tuple(own.observers[i] for i in near),
                    faults=tuple(own.faults[i] for i in chosen),
                    # As many columns as rows are enough.
                    free=np.transpose(np.linalg.qr(free[near].T, mode="r")),
                    covariance=covariance[np.ix_(near, near)],
                    slopes=slopes[near][:, chosen],
                )
            )
    return found


def _nearest(ruleset: Ruleset, part: Part, module: str) -> np.ndarray:
    """Estimates of a part nearest to a module, as flags: those the fewest junctions away."""
    order, front = {module: None}, [module]
    own = [o.module for o in part.ruleset.observers]
    while front and sum(m in order for m in own) < limits.NEAREST_ESTIMATES:
        ends = [{*j.outlets, *j.inlets} for j in ruleset.junctions]
        reached = [m for near in ends if not near.isdisjoint(front) for m in sorted(near)]
        front = list(dict.fromkeys(m for m in reached if m not in order))
        order |= dict.fromkeys(front)
    return np.array([m in order for m in own], dtype=bool)


def reference_point(ruleset: Ruleset) -> Points:
    """One point at which all readings are those of the reference, without noise."""
    values, u, bad = {}, {}, {}
    for signal in ruleset.signals:
        values[signal.id] = np.array([signal.reference])
        u[signal.id] = systematic_u(signal, values[signal.id]) + np.zeros(1)
        bad[signal.id] = np.zeros(1, dtype=bool)
    return Points(values, u, u, bad, {})
