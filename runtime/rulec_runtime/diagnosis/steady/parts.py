"""The parts of a plant that share no estimates, each with a ruleset of its own.

What a large plant consists of is judged as so many small ones: the effort grows with their number,
and not with the square of it.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.redundancy import Block, blocks_of


@dataclass(frozen=True)
class Part:
    """A block of estimates with what concerns it; observers, residuals and faults by their places
    in the ruleset of the plant."""

    ruleset: Ruleset
    observers: np.ndarray
    residuals: np.ndarray
    faults: np.ndarray


def parts_of(ruleset: Ruleset) -> tuple[Part, ...]:
    """The parts in order of their first observer; worked out once for a ruleset."""
    if "parts" not in ruleset.kept:
        whole = ruleset.with_unlisted() if ruleset.unlisted else ruleset
        ruleset.kept["parts"] = tuple(_part(whole, block) for block in blocks_of(ruleset))
    found: tuple[Part, ...] = ruleset.kept["parts"]
    return found


def _part(ruleset: Ruleset, block: Block) -> Part:
    observers = np.flatnonzero(block.observers)
    residuals = _held(ruleset, block, "residuals")
    faults = _held(ruleset, block, "faults")
    listed = faults[ruleset.is_listed[faults]]
    if len(observers) == len(ruleset.observers):
        return Part(ruleset, observers, residuals, listed)
    own = replace(
        ruleset,
        observers=tuple(ruleset.observers[i] for i in observers),
        residuals=tuple(ruleset.residuals[i] for i in residuals),
        faults=tuple(ruleset.faults[i] for i in faults),
    )
    shown = {r.id for r in own.residuals}
    cells = tuple(c for c in ruleset.cells if c.residual in shown)
    names = {o.id for o in own.observers} | shown
    guards = {guard.output for o in own.observers for guard in o.guards}
    plan = ruleset.plan.select(
        name for name in ruleset.plan.outputs if name in guards or _of(name) & names
    )
    undo = ruleset.undo.select(name for name in ruleset.undo.outputs if _of(name) & names)
    return Part(
        replace(own, cells=cells, plan=plan.narrowed(), undo=undo.narrowed()),
        observers,
        residuals,
        listed,
    )


def _held(ruleset: Ruleset, block: Block, what: str) -> np.ndarray:
    """Places of the residuals or faults that concern a block."""
    concerned = [block.holds(ruleset, part) for part in getattr(ruleset, what)]
    return np.flatnonzero(np.array(concerned, dtype=bool))


def _of(output: str) -> Set[str]:
    """What an output of a plan may tell of: ``kind:of:...``, or the residual of a rule at its
    end."""
    kind, _, rest = output.partition(":")
    return {rest.rpartition(":")[2] if kind in ("x", "ux") else rest.split(":")[0]}
