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


def with_free_states(
    dynamics: Dynamics, moving: tuple[str, ...] = (), switched: str = ""
) -> Balances:
    """The balances with every initial state as a plan input.

    Plan inputs named in `moving` are given sample by sample, after the readings; so is last whether
    the fault `switched` is present, 0 or 1.
    """
    old, on = dynamics.plan, f"on.{switched}"
    starts = [start_of(s.id) for s in dynamics.states]
    added = (*starts, *((on,) if switched else ()))
    inputs = (*old.inputs, *added)
    index = {name: i for i, name in enumerate(inputs)}
    degree = index[f"x.{switched}"] if switched else -1
    first = len(inputs) + len(old.constants)

    def moved(i: int) -> int:
        if i == degree:
            return first
        return (
            i
            if i < len(old.inputs)
            else i + len(added) + bool(switched) * (i >= old.first_operation)
        )

    operations = (
        *((("mul", degree, index[on]),) if switched else ()),
        *((name, moved(a), 0 if name in UNARY else moved(b)) for name, a, b in old.operations),
    )
    outputs = {name: moved(i) for name, i in old.outputs.items()}
    outputs |= {f"start:{s.id}": index[start_of(s.id)] for s in dynamics.states}
    plan = Plan(inputs, old.constants, operations, outputs)
    return Balances(
        plan,
        tuple(s.id for s in dynamics.states),
        (*dynamics.inputs, *moving, *((on,) if switched else ())),
        tuple(f"{SHOWN}{name}" for name in dynamics.outputs),
    )
