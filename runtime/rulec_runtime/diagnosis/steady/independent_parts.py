"""The parts of a plant that share no estimates, each with a ruleset of its own.

A large plant is judged as many small ones: the effort grows linearly with their number, not
quadratically.
"""

from collections.abc import Iterable, Set
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.ruleset import LiquidSpec, Ruleset
from rulec_runtime.diagnosis.steady.redundancy import blocks_of


@dataclass(frozen=True)
class Part:
    """A block of estimates with all that concerns it; observers and residuals by their places in
    the ruleset of the plant. In that of the part, changes of the liquid follow the faults."""

    ruleset: Ruleset
    observers: np.ndarray
    residuals: np.ndarray


def parts_of(ruleset: Ruleset) -> tuple[Part, ...]:
    """The parts in order of their first observer; worked out once for a ruleset."""
    if "parts" not in ruleset.cache:
        whole = ruleset.with_unlisted() if ruleset.unlisted else ruleset
        ruleset.cache["parts"] = tuple(_part(whole, flags) for flags in blocks_of(ruleset))
    found: tuple[Part, ...] = ruleset.cache["parts"]
    return found


def _part(ruleset: Ruleset, flags: np.ndarray) -> Part:
    observers = np.flatnonzero(flags)
    members = {ruleset.observers[i].id for i in observers}
    reached = [not members.isdisjoint(t.observer for t in r.terms) for r in ruleset.residuals]
    residuals = np.flatnonzero(np.array(reached, dtype=bool))
    if len(observers) == len(ruleset.observers):
        return Part(_with_liquid(ruleset, ruleset.liquid), observers, residuals)
    own = replace(
        ruleset,
        observers=tuple(ruleset.observers[i] for i in observers),
        residuals=tuple(ruleset.residuals[i] for i in residuals),
        faults=tuple(f for f in ruleset.faults if not members.isdisjoint(f.affects)),
    )
    shown = {r.id for r in own.residuals}
    cells = tuple(c for c in ruleset.cells if c.residual in shown)
    names = members | shown
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
        # Results of controllers do not say how a change of the liquid moves an observer.
        moved = (o for o in change.fault.affects if f"ql:{o}" in ruleset.undo.outputs)
        affects = tuple(o for o in moved if o in there)
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
"""Outputs of the plan with changes of the liquid undone, and the outputs that they replace."""


def _of(output: str) -> Set[str]:
    """Owners of an output of a plan: ``kind:of:...``, or the residual of a rule at its end."""
    kind, _, rest = output.partition(":")
    return {rest.rpartition(":")[2] if kind in ("x", "ux") else rest.split(":")[0]}
