"""What an explanation changes, sample by sample, and in which region that is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.evidence.stores.simulation_problem import SHOWN, Bench

Variable = tuple[Array, float, float, str]
"""A course, SI, with factor, offset and unit to show it in."""


def term_of(bench: Bench, fitted: Fitted, candidate: Candidate) -> Array:
    """What a candidate changes in balances and sensors along the repaired course, squared.

    Shape (n,), each part over its scatter; zero where the candidate stores something itself, as
    then it cannot be switched off at a moment.
    """
    balances = bench.balances(fitted.ids)
    said = bench.simulate(fitted.ids, fitted.values, inputs=fitted.inputs)
    values = {**bench.plain_values, **fitted.values, "time": bench.time}
    known = {n: np.asarray(values[n]) for n in balances.plan.inputs if n in values}
    known |= {n: fitted.inputs[n] for n in balances.inputs}
    courses = said.course.states
    known |= {n: np.ascontiguousarray(courses[:, i]) for i, n in enumerate(balances.states)}
    off = {u.id: u.null for u in candidate.unknowns if u.null is not None}
    outputs = [n for n in balances.plan.outputs if n.startswith(("der:", SHOWN))]
    plan = balances.plan.select(outputs)
    here, there = (plan.run({**known, **extra}) for extra in ({}, off))
    total = np.zeros(len(bench.time))
    for name in outputs:
        # A lag that is switched off at a moment has no rate.
        with np.errstate(all="ignore"):
            change = here[name] - there[name]
        change = np.where(np.isfinite(change), change, 0.0)
        scatter, size = float(np.nanstd(here[name])), float(np.nanmax(np.abs(here[name])))
        if scatter > 1e-12 * size:
            total += (change / scatter) ** 2
    return np.asarray(np.broadcast_to(total, bench.time.shape))


def variables_of(bench: Bench, fitted: Fitted, module: str) -> dict[str, Variable]:
    """Courses in which a region can be told: states of the plant, what is given, time.

    Those of the module come first.
    """
    found: dict[str, Variable] = {}
    assert bench.ruleset.dynamics is not None
    for state in bench.ruleset.dynamics.states:
        course = bench.trajectory(fitted.ids, fitted.values, state.id, fitted.inputs)
        found[state.id] = (course, state.factor, state.offset, state.unit)
    for name, course in bench.record.inputs.items():
        signal = bench.ruleset.signal_by_id[name]
        found[name] = (course, signal.factor, signal.offset, signal.unit)
    own = {n: v for n, v in found.items() if n.partition(".")[0] == module}
    return {**own, **found}


def driving(candidate: Candidate, variables: Mapping[str, Variable]) -> dict[str, Variable]:
    """Those that drive a candidate."""
    return {n: v for n, v in variables.items() if n in candidate.drivers.values()}
