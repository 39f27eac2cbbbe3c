"""What an explanation says of quantities that nobody reads, at the operating points recorded: flows
of modules, and what sensors should have shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.algebra.tangent import run_with_slopes
from rulec.mismatch.evidence.steady.configuration import CHANGE, Configuration
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.experiment import limits
from rulec.mismatch.search.evidence import Term
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry, driver_of
from rulec.mismatch.search.settled.posterior_curve import columns_of, size_of_term, solved

Quantity = tuple[str, str]
"""A module, and its own signal; no signal for the flow through it."""


@dataclass(frozen=True)
class Claims:
    """What one explanation says; per quantity its value, SI or m3/s, and the standard uncertainty
    by the doubt of all its numbers, shape (points,) each."""

    value: Mapping[Quantity, Array]
    u: Mapping[Quantity, Array]


def claims_of(geometry: Geometry, model: Model) -> Claims:
    """All that one explanation says of quantities, at the points of `geometry`."""
    system = geometry.rows.system
    solution, known = solved(model)
    numbers = [*range(len(model.at))]
    for term in model.terms:
        numbers += columns_of(model, term).tolist()
    at = np.concatenate([model.at, solution[numbers[len(model.at) :]]])
    covariance = known[np.ix_(numbers, numbers)]
    value = _claimed(system, model, at)
    slopes: dict[Quantity, list[Array]] = {quantity: [] for quantity in value}
    steps = limits.CLAIM_STEP * np.sqrt(np.diag(covariance))
    for number, step in enumerate(steps):
        moved = at.copy()
        moved[number] += step
        for quantity, there in _claimed(system, model, moved).items():
            slopes[quantity].append((there - value[quantity]) / step)
    u = {}
    for quantity, table in slopes.items():
        by = np.stack(table)
        u[quantity] = np.sqrt(np.einsum("in,ij,jn->n", by, covariance, by))
    return Claims(value, u)


def _claimed(system: System, model: Model, at: Array) -> dict[Quantity, Array]:
    """Values of all quantities at some numbers of a model."""
    setting, builder = _placed(model, at), system.builder
    inputs = system.corrected(setting)
    spots, first = [], len(model.at)
    own_spots = {spot.id for spot in builder.spots}
    for term in model.terms:
        count = term.columns.shape[1]
        shift = _term(system, model, term, at[first : first + count])
        first += count
        if term.changed.id in own_spots:
            spots.append(term.changed.id)
            inputs[term.changed.unknown] = shift
        else:
            # Of a parameter it is the change that is unknown.
            name = term.changed.unknown.removesuffix(CHANGE)
            inputs[name] = inputs[name] + shift
    found: dict[Quantity, Array] = {}
    for module in system.modules:
        plan = builder.plan(module, setting.ids, tuple(spots), definitions=True)
        out = run_with_slopes(plan, inputs, ())[0]
        estimates = [
            out[f"q:{o.id}"] + _zero(system) for o in system.observers if o.module == module
        ]
        found[module, ""] = np.mean(estimates, axis=0)
        corrected = builder.amended(module, _joined_to(module, setting)).corrected
        for name in system.shared:
            owner, _, signal = name.partition(".")
            if owner == module:
                shown = inputs[name]
                shown = out[f"d:{corrected[signal]}"] if signal in corrected else shown
                for term in model.terms:
                    changed = term.changed
                    if (changed.kind, changed.module, changed.place) == ("signal", owner, signal):
                        shown = shown - inputs[changed.unknown]
                found[module, signal] = shown + _zero(system)
    return found


def _zero(system: System) -> Array:
    return np.zeros(len(system.data))


def _joined_to(module: str, setting: Configuration) -> tuple[str, ...]:
    """Ids of what is joined to a module, in order."""
    every = {c.id: c for c in setting.joined}
    return tuple(
        id_
        for id_ in setting.ids
        if any(o.partition(".")[0] == module for o in every[id_].observers)
    )


def _placed(model: Model, at: Array) -> Configuration:
    names = model.prior.names
    values = dict(zip(names, at[: len(names)].tolist(), strict=True))
    return replace(model.setting, values={**model.setting.values, **values})


def _term(system: System, model: Model, term: Term, numbers: Array) -> Array:
    """How far a term without a name shifts its place, shape (points,)."""
    driver = driver_of(system, term.driver)
    shift: Array = size_of_term(model, term) * term.basis.at(driver[: len(system.data)]) @ numbers
    return shift
