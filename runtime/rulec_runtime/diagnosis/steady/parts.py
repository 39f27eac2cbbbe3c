"""The parts of a plant that share no estimates, each with a ruleset of its own.

What a large plant consists of is judged as so many small ones: the effort grows with their number,
and not with the square of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Set
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.ruleset import LiquidSpec, Ruleset
from rulec_runtime.diagnosis.steady.redundancy import Block, blocks_of


@dataclass(frozen=True)
class Part:
    """A block of estimates with what concerns it; observers and residuals by their places in the
    ruleset of the plant. The ruleset of the part has changes of the liquid behind its faults."""

    ruleset: Ruleset
    observers: np.ndarray
    residuals: np.ndarray


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
    if len(observers) == len(ruleset.observers):
        return Part(_with_liquid(ruleset, ruleset.liquid), observers, residuals)
    own = replace(
        ruleset,
        observers=tuple(ruleset.observers[i] for i in observers),
        residuals=tuple(ruleset.residuals[i] for i in residuals),
        faults=tuple(ruleset.faults[i] for i in _held(ruleset, block, "faults")),
    )
    shown = {r.id for r in own.residuals}
    cells = tuple(c for c in ruleset.cells if c.residual in shown)
    names = {o.id for o in own.observers} | shown
    guards = {guard.output for o in own.observers for guard in o.guards}
    plan = ruleset.plan.select(
        name for name in ruleset.plan.outputs if name in guards or _of(name) & names
    )
    undo = ruleset.undo.select(name for name in ruleset.undo.outputs if _of(name) & names)
    own = replace(own, cells=cells, plan=plan.narrowed(), undo=undo.narrowed())
    return Part(_with_liquid(own, ruleset.liquid), observers, residuals)


def _with_liquid(ruleset: Ruleset, changes: Iterable[LiquidSpec]) -> Ruleset:
    """The ruleset of a part with those changes of the liquid that several of its modules show."""
    there, shown = ruleset.observer_index, {r.id for r in ruleset.residuals}
    found = []
    for change in changes:
        affects = tuple(o for o in change.fault.affects if o in there and _moved(ruleset, o))
        if len({ruleset.observer_by_id[o].module for o in affects}) > 1:
            cells = tuple(c for c in change.cells if c.residual in shown)
            fault = replace(change.fault, affects=affects)
            found.append(replace(change, fault=fault, cells=cells))
    if not found:
        return ruleset
    outputs = dict(ruleset.undo.outputs)
    for name in ruleset.undo.outputs:
        kind, _, rest = name.partition(":")
        if kind in _MOVED:
            outputs[f"{_MOVED[kind]}:{rest}"] = outputs.pop(name)
    return replace(
        ruleset,
        faults=(*ruleset.faults, *(change.fault for change in found)),
        cells=(*ruleset.cells, *(cell for change in found for cell in change.cells)),
        undo=replace(ruleset.undo, outputs=outputs),
        liquid=tuple(found),
    )


_MOVED = {"ql": "q", "dql": "dq"}
"""Outputs of the plan with changes of the liquid undone, and in whose place they stand."""


def _moved(ruleset: Ruleset, observer: str) -> bool:
    """Does the plan know how a change of the liquid moves an observer? Results of controllers do
    not."""
    return f"ql:{observer}" in ruleset.undo.outputs


def _held(ruleset: Ruleset, block: Block, what: str) -> np.ndarray:
    """Places of the residuals or faults that concern a block."""
    concerned = [block.holds(ruleset, part) for part in getattr(ruleset, what)]
    return np.flatnonzero(np.array(concerned, dtype=bool))


def _of(output: str) -> Set[str]:
    """What an output of a plan may tell of: ``kind:of:...``, or the residual of a rule at its
    end."""
    kind, _, rest = output.partition(":")
    return {rest.rpartition(":")[2] if kind in ("x", "ux") else rest.split(":")[0]}
