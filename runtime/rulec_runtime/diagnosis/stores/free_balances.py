"""Balances with free start and free errors of inputs, for the fit of a window."""

import numpy as np

from rulec_runtime.contract.plan import UNARY, Array, Operation, Plan
from rulec_runtime.contract.ruleset import Dynamics
from rulec_runtime.simulation.balances import Balances

SHOWN = "shown:"


def start_of(state: str) -> str:
    """Plan input of the initial value of a state."""
    return f"begin.{state}"


def error_of(signal: str) -> str:
    """Plan input of the error of an input reading: reading less true value."""
    return f"error.{signal}"


def nominal_starts(dynamics: Dynamics) -> Array:
    """Initial states by the plant's file, SI, shape (states,)."""
    names = [f"start:{s.id}" for s in dynamics.states]
    found = dynamics.plan.select(names).run({n: np.asarray(v) for n, v in dynamics.values.items()})
    return np.array([found[name].item() for name in names])


def with_free_states(dynamics: Dynamics, moving: tuple[str, ...] = ()) -> Balances:
    """The balances with every initial state, and the error of every input reading, as plan inputs.

    Degrees named in `moving` are given sample by sample, after the readings.
    """
    old = dynamics.plan
    starts = [start_of(s.id) for s in dynamics.states]
    errors = [error_of(name) for name in dynamics.inputs]
    inputs = (*old.inputs, *starts, *errors)
    index = {name: i for i, name in enumerate(inputs)}
    first, more = len(inputs) + len(old.constants), len(starts) + len(errors)
    true: list[Operation] = [("sub", index[n], index[error_of(n)]) for n in dynamics.inputs]
    corrected = {index[name]: first + i for i, name in enumerate(dynamics.inputs)}

    def moved(i: int) -> int:
        if i < len(old.inputs):
            return corrected.get(i, i)
        return i + more + (len(true) if i >= old.first_operation else 0)

    operations = [
        (name, moved(a), 0 if name in UNARY else moved(b)) for name, a, b in old.operations
    ]
    outputs = {name: moved(i) for name, i in old.outputs.items()}
    outputs |= {f"start:{s.id}": index[start_of(s.id)] for s in dynamics.states}
    plan = Plan(inputs, old.constants, (*true, *operations), outputs)
    return Balances(
        plan,
        tuple(s.id for s in dynamics.states),
        (*dynamics.inputs, *moving),
        tuple(f"{SHOWN}{name}" for name in dynamics.outputs),
    )
