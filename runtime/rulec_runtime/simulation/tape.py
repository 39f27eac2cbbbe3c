"""A plan in the form that the integrator reads: numbers of operations and of slots."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.plan import OPERATIONS, UNARY, Plan

TIME = "time"

CODES = {name: code for code, name in enumerate(OPERATIONS)}
"""Numbers of operations in the integrator."""

Slots = NDArray[np.int64]


class Tape(NamedTuple):
    """Operations on numbered values: number, operands; the first result is value `first`.

    Operations that no state, input or time reaches run once, before operation `begin`. `clock` is
    the slot of time, or -1; `states` and `inputs` are slots that are written to. Per state there
    are the slots of its start, rate, limits and dead time; the last three may be -1.
    """

    first: int
    codes: Slots
    left: Slots
    right: Slots
    begin: int
    clock: int
    states: Slots
    starts: Slots
    rates: Slots
    lows: Slots
    highs: Slots
    afters: Slots
    inputs: Slots
    outputs: Slots


class Kernel(NamedTuple):
    """Addresses of machine code of a tape, 0 where there is none."""

    evaluate: int
    advance: int
    jacobian: int


def tape_of(
    plan: Plan, states: Sequence[str], inputs: Sequence[str], shown: Sequence[str]
) -> tuple[Tape, int]:
    """The tape of a narrowed plan, and its number of values."""
    place = {name: i for i, name in enumerate(plan.inputs)}
    moving = {place[n] for n in (*states, *inputs, TIME) if n in place}
    first = plan.first_operation
    still, moved = [], []
    for i, (name, a, b) in enumerate(plan.operations, first):
        if moving.intersection((a,) if name in UNARY else (a, b)):
            moving.add(i)
            moved.append(i)
        else:
            still.append(i)
    number = {i: i for i in range(first)}
    number |= {i: first + j for j, i in enumerate([*still, *moved])}
    operations = [plan.operations[i - first] for i in (*still, *moved)]
    right = [number[a if name in UNARY else b] for name, a, b in operations]
    # States and inputs that nothing reads still need a slot to be written to.
    spare = first + len(operations)
    absent = [n for n in (*states, *inputs) if n not in place]
    slot = {**place, **{name: spare + i for i, name in enumerate(absent)}}
    outputs = {name: number[i] for name, i in plan.outputs.items()}

    def of_states(what: str) -> Slots:
        return _slots([outputs.get(f"{what}:{s}", -1) for s in states])

    tape = Tape(
        first=first,
        codes=_slots([CODES[name] for name, _, _ in operations]),
        left=_slots([number[a] for _, a, _ in operations]),
        right=_slots(right),
        begin=len(still),
        clock=place.get(TIME, -1),
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
