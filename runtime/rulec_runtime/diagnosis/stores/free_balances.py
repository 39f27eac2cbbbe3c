"""Balances with a free start, for the fit of a window."""

import numpy as np

from rulec_runtime.contract.plan import UNARY, Array, Plan
from rulec_runtime.contract.ruleset import Dynamics
from rulec_runtime.simulation.balances import Balances

SHOWN = "shown:"


def start_of(state: str) -> str:
    """Plan input of the initial value of a state."""
    return f"begin.{state}"


def error_of(signal: str) -> str:
    """Plan input of the error of an input reading: reading less true value."""
    return f"error.{signal}"


def share_of(signal: str) -> str:
    """Plan input of the same as a share of the reading, of a sensor whose class states one."""
    return f"share.{signal}"


def nominal_starts(dynamics: Dynamics) -> Array:
    """Initial states by the plant's file, SI, shape (states,)."""
    names = [f"start:{s.id}" for s in dynamics.states]
    found = dynamics.plan.select(names).run({n: np.asarray(v) for n, v in dynamics.values.items()})
    return np.array([found[name].item() for name in names])


def with_free_states(dynamics: Dynamics, moving: tuple[str, ...] = ()) -> Balances:
    """The balances with every initial state as a plan input.

    Degrees named in `moving` are given sample by sample, after the readings.
    """
    old = dynamics.plan
    inputs = (*old.inputs, *(start_of(s.id) for s in dynamics.states))
    index = {name: i for i, name in enumerate(inputs)}

    def moved(i: int) -> int:
        return i if i < len(old.inputs) else i + len(dynamics.states)

    operations = tuple(
        (name, moved(a), 0 if name in UNARY else moved(b)) for name, a, b in old.operations
    )
    outputs = {name: moved(i) for name, i in old.outputs.items()}
    outputs |= {f"start:{s.id}": index[start_of(s.id)] for s in dynamics.states}
    plan = Plan(inputs, old.constants, operations, outputs)
    return Balances(
        plan,
        tuple(s.id for s in dynamics.states),
        (*dynamics.inputs, *moving),
        tuple(f"{SHOWN}{name}" for name in dynamics.outputs),
    )
