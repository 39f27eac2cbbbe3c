"""Pairs of faults and the steps that tell them apart: for the terminal, and as JSON data."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.parts import Table, shown

from rulec.limits import SEPARATED
from rulec.separation.allowed import Allowed
from rulec.separation.distance import FaultMeasure
from rulec.separation.limits import STEP_DEGREES
from rulec.separation.propose import Proposal, costs_in_words, propose, set_points
from rulec.simulation.equations import equations_of

STEP = "step from the reference point"


def show_separated(out: Console, ruleset: Ruleset, pairs: Sequence[Separated]) -> None:
    """Print what one step achieves, then a row per pair."""
    close = [p for p in pairs if not p.is_apart]
    split = sum(p.is_split for p in close)
    out.print(styled("\n[bold]One change of set points[/]\n"))
    text = (
        f"{len(pairs)} pairs of faults look alike; {len(pairs) - len(close)} can be separated "
        f"at the reference point ({SEPARATED:g} sigma)"
    )
    if not close:
        out.print(text)
        return
    every = "all" if split == len(close) else split
    out.print(f"{text}, and one change of set points separates {every} of the other {len(close)}")
    degrees = " / ".join(f"{d:g}" for d in STEP_DEGREES)
    titles = ("faults", f"sigma now\nat degree\n{degrees}", f"then\nat degree\n{degrees}", STEP)
    reference, rows = {s.id: s.shown(s.reference) for s in ruleset.signals}, []
    for pair in close:
        now, then = pair.proposal.here, pair.proposal.apart if pair.proposal.changes else ()
        sigma = (" / ".join(f"{v:.1f}" for v in part) or "–" for part in (now, then))
        step = "none in the permitted range"
        if pair.proposal.changes:
            step = set_points(ruleset, reference, pair.proposal) + costs_in_words(pair.proposal)
            step += "" if pair.is_split else "; not enough at every degree"
        rows.append((", ".join(pair.faults), *sigma, step))
    out.print(shown(Table(titles, rows, broken=(STEP,))))


def separated_form(ruleset: Ruleset, pairs: Sequence[Separated]) -> list[dict[str, Any]]:
    """One entry per pair; set points in the unit of the sensor, times in s."""
    return [
        {
            "faults": list(pair.faults),
            "kind": pair.kind,
            "sigma": [
                {"degree": degree, "now": now, "then": then}
                for degree, now, then in zip(
                    STEP_DEGREES, pair.proposal.here, pair.proposal.apart, strict=True
                )
            ],
            "changes": [
                {"input": name, "to": value, "unit": ruleset.signal_by_id[name].unit}
                for name, value in pair.proposal.changes.items()
            ],
            "ramp": pair.proposal.ramp,
            "hold": pair.proposal.hold,
            "costs_product": list(pair.proposal.costs),
            "apart_already": pair.is_apart,
            "split": pair.is_split,
        }
        for pair in pairs
    ]


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
    pairs: dict[frozenset[str], tuple[tuple[str, str], str]] = {}
    for group in ruleset.ambiguous:
        for pair in itertools.combinations(group.faults, 2):
            pairs.setdefault(frozenset(pair), (pair, group.kind))
    for pair, kind in pairs.values():
        a, b = (ruleset.fault_by_id[name] for name in pair)
        measure = FaultMeasure(
            equations=equations,
            present={s.id: s.reference for s in signals},
            bounds=allowed.readings,
            rows=[[(a, d * a.scale, b), (b, d * b.scale, a)] for d in STEP_DEGREES],
        )
        yield Separated(pair, kind, propose(allowed, shown, measure))
