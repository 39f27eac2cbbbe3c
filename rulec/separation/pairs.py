"""Pairs of faults that are hard to tell apart at the reference point, and steps that do so."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from rulec_runtime.contract.ruleset import Ruleset

from rulec.limits import SEPARATED
from rulec.separation.allowed import Allowed
from rulec.separation.distance import Case, FaultMeasure
from rulec.separation.limits import STEP_DEGREES
from rulec.separation.propose import Proposal, propose
from rulec.simulation.equations import equations_of


@dataclass(frozen=True)
class Separated:
    """Two faults, the kind of their similarity as in the matrix, and the step that separates them
    best. The proposal has a row for each of `STEP_DEGREES`."""

    faults: tuple[str, str]
    kind: str
    proposal: Proposal

    @property
    def is_apart(self) -> bool:
        """Whether the reference point alone tells them apart at every degree."""
        return min(self.proposal.here) >= SEPARATED

    @property
    def is_split(self) -> bool:
        """Whether the step tells them apart at every degree."""
        return min(self.proposal.apart) >= SEPARATED


def separate_pairs(ruleset: Ruleset, allowed: Allowed) -> Iterator[Separated]:
    """All pairs that the matrix calls ambiguous, in its order.

    Raises `SimulationRefused` if the plant cannot be simulated.
    """
    equations = equations_of(ruleset)
    signals = equations.given_signals
    shown = {s.id: s.shown(s.reference) for s in signals}
    done: set[frozenset[str]] = set()
    for group in ruleset.ambiguous:
        for pair in itertools.combinations(group.faults, 2):
            if frozenset(pair) in done:
                continue
            done.add(frozenset(pair))
            a, b = (ruleset.fault_by_id[name] for name in pair)
            measure = FaultMeasure(
                equations=equations,
                present={s.id: s.reference for s in signals},
                bounds=allowed.readings,
                rows=[[Case(a, d * a.scale, b), Case(b, d * b.scale, a)] for d in STEP_DEGREES],
            )
            yield Separated(pair, group.kind, propose(allowed, shown, measure))
