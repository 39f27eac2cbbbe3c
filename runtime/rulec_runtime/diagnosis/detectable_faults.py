"""Which faults the readings of a plant can show, and which become undetectable without some.

The estimates, or balances, near the reference point of the ruleset decide, by the usual threshold.
A fault that the sheet's uncertainties hide at any degree counts as detectable while it leaves a
trace: recordings will lower these uncertainties.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import combinations
from math import comb, inf

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import ObserverSpec, Ruleset
from rulec_runtime.contract.threshold import threshold_of
from rulec_runtime.diagnosis.steady.chi_square import inverse_of
from rulec_runtime.diagnosis.steady.hypothesis import test_of
from rulec_runtime.diagnosis.steady.independent_parts import Part, parts_of
from rulec_runtime.diagnosis.steady.observe import observe_part
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.diagnosis.steady.redundancy import free_flows, vanishing
from rulec_runtime.recordings.stationary import systematic_u

NONE: frozenset[str] = frozenset()


@dataclass(frozen=True)
class VisiblePart:
    """A part of a plant that is judged on its own: the signals that it reads, its observers by id,
    and its faults with their largest degrees.

    `worked_out` gives products of the effects of all faults with each other, shape (faults,
    faults), in the metric of errors, without lost signals and without the observers at standstill;
    0 where a fault leaves no trace.
    """

    signals: frozenset[str]
    observers: frozenset[str]
    highest: Mapping[str, float]
    worked_out: Callable[[Set[str], Set[str]], Array]
    cache: dict[tuple[Set[str], Set[str]], Array] = field(default_factory=dict)

    def information(self, lost: Set[str], still: Set[str] = NONE) -> Array:
        """These products, worked out once for all that matters here."""
        key = frozenset(lost & self.signals), frozenset(still & self.observers)
        if key not in self.cache:
            self.cache[key] = self.worked_out(*key)
        return self.cache[key]

    def sees(self, fault: str, lost: Set[str], still: Set[str]) -> bool:
        """Whether a degree within the range of a fault is detectable, or any if its sheet hides
        all."""
        i, highest = [*self.highest].index(fault), self.highest[fault]
        amounts = (float(self.information(*of)[i, i]) for of in ((lost, still), (NONE, NONE)))
        degree, sheet = (threshold_of(x**-0.5) if x > 0.0 else inf for x in amounts)
        return degree < (highest if sheet < highest else inf)


@dataclass(frozen=True)
class Visible:
    """All parts of a plant."""

    parts: tuple[VisiblePart, ...]

    @cached_property
    def of_fault(self) -> Mapping[str, Sequence[VisiblePart]]:
        """The parts that may show each fault."""
        found: dict[str, list[VisiblePart]] = {}
        for one in self.parts:
            for fault in one.highest:
                found.setdefault(fault, []).append(one)
        return found

    def sees(self, fault: str, lost: Set[str] = NONE, still: Set[str] = NONE) -> bool:
        """Whether a fault is detectable without some signals, with some observers at standstill."""
        return any(one.sees(fault, lost, still) for one in self.of_fault.get(fault, ()))

    def unseen(self, lost: Set[str], still: Set[str] = NONE) -> list[str]:
        """Faults that only lost signals hide."""
        touched = [one for one in self.parts if not lost.isdisjoint(one.signals)]
        asked = dict.fromkeys(fault for one in touched for fault in one.highest)
        return [f for f in asked if self.sees(f, NONE, still) and not self.sees(f, lost, still)]

    def brings_back(self, fault: str, lost: Set[str], still: Set[str] = NONE) -> tuple[str, ...]:
        """The smallest set of lost signals that makes a fault detectable again; those of its own
        module first. If there are too many sets to try, a set of which all are needed."""
        read = NONE.union(*(one.signals for one in self.of_fault[fault]))
        module = fault.partition(".")[0]
        asked = sorted(lost & read, key=lambda s: (s.partition(".")[0] != module, s))

        def enough(back: Sequence[str]) -> bool:
            return self.sees(fault, lost - set(back), still)

        for size in range(1, len(asked) + 1):
            if comb(len(asked), size) > limits.SETS_TRIED:
                break
            for some in filter(enough, combinations(asked, size)):
                return some
        needed = list(asked)
        for signal in reversed(asked):
            fewer = [name for name in needed if name != signal]
            if enough(fewer):
                needed = fewer
        return tuple(needed)


def visible_of(ruleset: Ruleset) -> Visible:
    """What the readings of a plant can show; worked out once for a ruleset."""
    if "visible" not in ruleset.cache:
        ruleset.cache["visible"] = Visible(tuple(_parts(ruleset)))
    found: Visible = ruleset.cache["visible"]
    return found


def _parts(ruleset: Ruleset) -> Iterator[VisiblePart]:
    """The balances of a plant that stores; else its blocks of estimates, at the reference point. In
    a large block only the estimates nearest to its module decide whether a fault is detectable."""
    if (dynamics := ruleset.dynamics) is not None:
        # The integrator takes a second to load, and only plants that store need it.
        from rulec_runtime.diagnosis.stores.detectable_faults import information_of

        signals = frozenset((*dynamics.inputs, *dynamics.outputs))
        highest = {name: ruleset.fault_by_id[name].highest for name in dynamics.faults}
        yield VisiblePart(signals, NONE, highest, information_of(ruleset))
        return
    points, index = reference_point(ruleset), {name: i for i, name in enumerate(ruleset.modules)}
    for part in parts_of(ruleset):
        own, observed = part.ruleset, observe_part(ruleset, part, points)
        valid, point = observed.valid[:, 0], np.zeros(1, dtype=int)
        slopes = np.zeros((len(own.observers), len(own.faults)))
        each = test_of(own, observed, valid, point).each
        for column, (rows, slope) in each.items():
            slopes[np.flatnonzero(valid)[rows], column] = slope[:, 0, 0]
        covariance = observed.covariance_at(point)[0]
        free = free_flows(ruleset)[[index[o.module] for o in own.observers]]
        groups: dict[str, list[int]] = {}
        whole = len(own.observers) <= limits.NEAREST_ESTIMATES
        for i, fault in enumerate(own.faults):
            groups.setdefault("" if whole else fault.module, []).append(i)
        for module, chosen in groups.items():
            near = np.flatnonzero(valid & _nearest(ruleset, part, module) if module else valid)
            observers = tuple(own.observers[i] for i in near)
            # As many columns as rows are enough.
            basis = np.transpose(np.linalg.qr(free[near].T, mode="r"))
            tables = basis, covariance[np.ix_(near, near)], slopes[near][:, chosen]
            yield VisiblePart(
                frozenset(signal for o in observers for signal in o.signals),
                frozenset(o.id for o in observers),
                {own.faults[i].id: own.faults[i].highest for i in chosen},
                partial(_information, observers, *tables),
            )


def _information(
    observers: Sequence[ObserverSpec],
    free: Array,
    covariance: Array,
    slopes: Array,
    lost: Set[str],
    still: Set[str],
) -> Array:
    """What estimates that check each other say about faults. `free` are their flows by those that
    are free, shape (observers, free); `covariance` is theirs, (m3/s)^2, `slopes` theirs by the
    degree of each fault, shape (observers, faults), m3/s."""
    there = [o.id not in still and lost.isdisjoint(o.signals) for o in observers]
    usable = np.array(there, dtype=bool)
    basis, own = vanishing(free[usable]), slopes[usable]
    if not len(basis):
        return np.zeros((slopes.shape[1], slopes.shape[1]))
    effects = basis @ own
    size, largest = np.linalg.norm(effects, axis=0), np.abs(own).max(axis=0, initial=0.0)
    effects = np.where(size > limits.UNTOUCHED * largest, effects, 0.0)
    spread = basis @ covariance[np.ix_(usable, usable)] @ basis.T
    return np.asarray(effects.T @ inverse_of(spread[None])[0] @ effects)


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
