"""Balances whose start and whose given readings may be off: what a fit of a window moves."""

from __future__ import annotations

import numpy as np

from rulec_runtime.contract.plan import UNARY, Array, Operation, Plan
from rulec_runtime.contract.ruleset import Dynamics
from rulec_runtime.simulation.balances import Balances

SHOWN = "shown:"


def start_of(state: str) -> str:
    """Plan input of the value that a state starts from."""
    return f"begin.{state}"


def error_of(signal: str) -> str:
    """Plan input of the error of a given reading, which shows so much more than is there."""
    return f"error.{signal}"


def nominal_starts(dynamics: Dynamics) -> Array:
    """Where states start by the plant's file, SI, shape (states,)."""
    names = [f"start:{s.id}" for s in dynamics.states]
    found = dynamics.plan.select(names).run({n: np.asarray(v) for n, v in dynamics.values.items()})
    return np.array([found[name].item() for name in names])


def with_free_states(dynamics: Dynamics, moving: tuple[str, ...] = ()) -> Balances:
    """The balances with every start, and the error of every given reading, as plan inputs.

    Degrees named in `moving` are given sample by sample, behind the readings.
    """
    old = dynamics.plan
    starts = [start_of(s.id) for s in dynamics.states]
    errors = [error_of(name) for name in dynamics.inputs]
    inputs = (*old.inputs, *starts, *errors)
    place = {name: i for i, name in enumerate(inputs)}
    first, more = len(inputs) + len(old.constants), len(starts) + len(errors)
    true: list[Operation] = [("sub", place[n], place[error_of(n)]) for n in dynamics.inputs]
    corrected = {place[name]: first + i for i, name in enumerate(dynamics.inputs)}

    def moved(i: int) -> int:
        if i < len(old.inputs):
            return corrected.get(i, i)
        return i + more + (len(true) if i >= old.first_operation else 0)

    operations = [
        (name, moved(a), 0 if name in UNARY else moved(b)) for name, a, b in old.operations
    ]
    outputs = {name: moved(i) for name, i in old.outputs.items()}
    outputs |= {f"start:{s.id}": place[start_of(s.id)] for s in dynamics.states}
    plan = Plan(inputs, old.constants, (*true, *operations), outputs)
    return Balances(
        plan,
        tuple(s.id for s in dynamics.states),
        (*dynamics.inputs, *moving),
        tuple(f"{SHOWN}{name}" for name in dynamics.outputs),
    )
