"""Which faults the readings of a plant can show, and which of them no more without some.

What estimates, or balances, say of a fault near the reference point of the ruleset decides, by the
same threshold as everywhere. A fault that the sheet's uncertainties hide at any degree counts as
seen while it leaves a trace: what a recording teaches makes them smaller.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from math import comb, inf
from typing import Protocol

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.threshold import threshold_of
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest
from rulec_runtime.diagnosis.steady.isolate import test_of
from rulec_runtime.diagnosis.steady.observe import Observed, observe_part
from rulec_runtime.diagnosis.steady.parts import Part, parts_of
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.diagnosis.steady.redundancy import residual_basis
from rulec_runtime.recordings.stationary import systematic_u

NONE: frozenset[str] = frozenset()


class Sighted(Protocol):
    """A part of a plant that is judged on its own: the signals that it reads, and its faults."""

    @property
    def signals(self) -> frozenset[str]: ...

    @property
    def highest(self) -> Mapping[str, float]:
        """Faults with their largest degrees."""

    def detectable(self, lost: Set[str], still: Set[str]) -> Mapping[str, float]:
        """Degree from which on each fault can be seen without some signals while some observers,
        by their ids, estimate nothing; absent where it leaves no trace."""


@dataclass(frozen=True)
class PartSighted:
    """Estimates that check each other, at the reference point."""

    part: Part
    observed: Observed
    known: dict[bytes, Mapping[str, float]] = field(default_factory=dict)

    @cached_property
    def signals(self) -> frozenset[str]:
        return self.part.ruleset.observed

    @cached_property
    def highest(self) -> Mapping[str, float]:
        return {f.id: f.highest for f in self.part.ruleset.faults}

    def detectable(self, lost: Set[str], still: Set[str]) -> Mapping[str, float]:
        usable = self.usable(lost, still)
        key = usable.tobytes()
        if key not in self.known:
            self.known[key] = self._detectable(self.test(usable))
        return self.known[key]

    def usable(self, lost: Set[str], still: Set[str] = NONE) -> np.ndarray:
        """Estimates that can be used, by flags, shape (observers,)."""
        observers = self.part.ruleset.observers
        there = [o.id not in still and lost.isdisjoint(o.signals) for o in observers]
        usable: np.ndarray = self.observed.valid[:, 0] & np.array(there, dtype=bool)
        return usable

    def test(self, usable: np.ndarray) -> HypothesisTest | None:
        """What some estimates say of faults; None where they do not check each other."""
        basis = residual_basis(self.part.ruleset, usable)
        if not len(basis):
            return None
        return test_of(self.part.ruleset, self.observed, usable, basis, np.zeros(1, dtype=int))

    def _detectable(self, test: HypothesisTest | None) -> Mapping[str, float]:
        if test is None:
            return {}
        faults = self.part.ruleset.faults
        information: Array = test.towards()[1][:, 0]
        shown = [f for f in zip(faults, information.tolist(), strict=True) if f[1] > 0.0]
        return {f.id: threshold_of(known**-0.5) for f, known in shown if test.touched((f,))}


@dataclass(frozen=True)
class Visible:
    """All parts of a plant."""

    parts: tuple[Sighted, ...]

    def faults(self, lost: Set[str] = NONE, still: Set[str] = NONE) -> frozenset[str]:
        """Faults that can be seen without some signals while some observers stand still."""
        return NONE.union(*(self._of(one, lost, still) for one in self.parts))

    def unseen(self, lost: Set[str], still: Set[str] = NONE) -> frozenset[str]:
        """Faults that only lost signals hide."""
        return self.faults(NONE, still) - self.faults(lost, still)

    def _of(self, one: Sighted, lost: Set[str], still: Set[str]) -> frozenset[str]:
        return frozenset(fault for fault in one.highest if _sees(one, fault, lost, still))

    def brings_back(self, fault: str, lost: Set[str], still: Set[str] = NONE) -> tuple[str, ...]:
        """The fewest of the lost signals with which a fault can be seen again; those of its own
        module first. Where too many sets would have to be tried, a set of which all are needed."""
        own = [one for one in self.parts if fault in one.highest]
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
    """Is a degree seen that is within the range of a fault, or any where its sheet hides all?"""
    degree = one.detectable(lost, still).get(fault, inf)
    sheet = one.detectable(NONE, NONE).get(fault, inf)
    return degree < (one.highest[fault] if sheet < one.highest[fault] else inf)


def visible_of(ruleset: Ruleset) -> Visible:
    """What the readings of a plant can show; worked out once for a ruleset."""
    if "visible" not in ruleset.kept:
        ruleset.kept["visible"] = Visible(tuple(_parts(ruleset)))
    found: Visible = ruleset.kept["visible"]
    return found


def _parts(ruleset: Ruleset) -> list[Sighted]:
    if ruleset.dynamics is not None:
        # The integrator takes a second to load, and plants that store nothing do without it.
        from rulec_runtime.diagnosis.stores.sighted import sighted

        return [sighted(ruleset)]
    return [*settled_parts(ruleset)]


def settled_parts(ruleset: Ruleset) -> list[PartSighted]:
    """The parts of a plant that settles, at its reference point."""
    points = reference_point(ruleset)
    return [PartSighted(one, observe_part(ruleset, one, points)) for one in parts_of(ruleset)]


def reference_point(ruleset: Ruleset) -> Points:
    """One point at which all readings are those of the reference, without noise."""
    values, u, bad = {}, {}, {}
    for signal in ruleset.signals:
        values[signal.id] = np.array([signal.reference])
        u[signal.id] = systematic_u(signal, values[signal.id]) + np.zeros(1)
        bad[signal.id] = np.zeros(1, dtype=bool)
    return Points(values, u, u, bad, {})
