"""A plan in the form that the integrator reads: numbers of operations and of slots."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.plan import OPERATIONS, UNARY, Plan

TIME = "time"

OF_STATES = ("start", "der", "low", "high", "after")
"""Outputs per state, as in `contract.ruleset.Dynamics`."""

CODES = {name: code for code, name in enumerate(OPERATIONS)}
"""Numbers of operations in the integrator."""

Slots = NDArray[np.int64]


class Tape(NamedTuple):
    """Operations on numbered values: number, operands; the first result is value `first`.

    Operations that no state, input or time reaches run once, before operation `begin`; rates and
    dead times need none from operation `rated` on. `clock` is
    the slot of time, or -1; `states` and `inputs` are slots that are written to. Per state there
    are the slots of its start, rate, limits and dead time; the last three may be -1.
    """

    first: int
    codes: Slots
    left: Slots
    right: Slots
    begin: int
    rated: int
    clock: int
    states: Slots
    starts: Slots
    rates: Slots
    lows: Slots
    highs: Slots
    afters: Slots
    inputs: Slots
    outputs: Slots


def tape_of(
    plan: Plan, states: Sequence[str], inputs: Sequence[str], shown: Sequence[str]
) -> tuple[Tape, int]:
    """The tape of a narrowed plan, and its number of values."""
    index = {name: i for i, name in enumerate(plan.inputs)}
    moving = {index[n] for n in (*states, *inputs, TIME) if n in index}
    first = plan.first_operation
    # What rates need comes first: between samples nothing else is read.
    roots = [i for n, i in plan.outputs.items() if n.partition(":")[0] in ("der", "after")]
    early = set(plan.needed(roots))
    rest = sorted(set(range(first, first + len(plan.operations))).difference(early))
    still, moved, rating = [], [], 0
    for i in (*sorted(early), *rest):
        name, a, b = plan.operations[i - first]
        if moving.intersection((a,) if name in UNARY else (a, b)):
            moving.add(i)
            moved.append(i)
        else:
            still.append(i)
        rating = len(moved) if i in early else rating
    number = {i: i for i in range(first)}
    number |= {i: first + j for j, i in enumerate([*still, *moved])}
    operations = [plan.operations[i - first] for i in (*still, *moved)]
    right = [number[a if name in UNARY else b] for name, a, b in operations]
    # States and inputs that nothing reads still need a slot to be written to.
    spare = first + len(operations)
    absent = [n for n in (*states, *inputs) if n not in index]
    slot = {**index, **{name: spare + i for i, name in enumerate(absent)}}
    outputs = {name: number[i] for name, i in plan.outputs.items()}

    def of_states(what: str) -> Slots:
        return _slots([outputs.get(f"{what}:{s}", -1) for s in states])

    tape = Tape(
        first=first,
        codes=_slots([CODES[name] for name, _, _ in operations]),
        left=_slots([number[a] for _, a, _ in operations]),
        right=_slots(right),
        begin=len(still),
        rated=len(still) + rating,
        clock=index.get(TIME, -1),
        states=_slots([slot[name] for name in states]),
        starts=of_states("start"),
        rates=of_states("der"),
        lows=of_states("low"),
        highs=of_states("high"),
        afters=of_states("after"),
        inputs=_slots([slot[name] for name in inputs]),
        outputs=_slots([outputs[name] for name in shown]),
    )
    return tape, spare + len(absent)


def _slots(numbers: Sequence[int]) -> Slots:
    return np.array(numbers, dtype=np.int64)
