"""Balances ready to be integrated: a plan in the form that the integrator reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.plan import OPERATIONS, UNARY, Array, Plan

TIME = "time"

CODES = {name: code for code, name in enumerate(OPERATIONS)}
"""Numbers of operations, as the integrator knows them."""

Slots = NDArray[np.int64]


class RanAway(Exception):
    """A state grew beyond all bounds; the parameters make no sense."""


@dataclass(frozen=True)
class Course:
    """What balances give over a recording.

    `shown` holds outputs, shape (samples, outputs), `slopes` their derivatives by the seeds, shape
    (samples, outputs, seeds), `states` the states, shape (samples, states). `steps` were taken.
    """

    shown: Array
    slopes: Array
    states: Array
    steps: int


@dataclass(frozen=True)
class Balances:
    """A plan with states and readings by id, and the readings that are given.

    `outputs` are names of outputs of the plan, as ``shown:lower.y``.
    """

    plan: Plan
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @cached_property
    def _tape(self) -> _Tape:
        return _Tape(self)

    def run(
        self,
        time: Array,
        inputs: Array,
        held: NDArray[np.bool_],
        values: Mapping[str, float],
        seeds: Sequence[str] = (),
    ) -> Course:
        """Integrate from the first sample to the last.

        Parameters
        ----------
        time : shape (n,), s, rising.
        inputs : shape (n, inputs), SI, all finite.
        held : per input, whether it keeps its value up to the next sample; else it is interpolated.
        values : per parameter a value, SI; absent ones count as 0.
        seeds : parameters by which the outputs are differentiated.

        Raises `RanAway`.
        """
        # To load the integrator's compiler takes longer than to read a plant.
        from rulec_runtime.simulation.integrator import integrate

        tape = self._tape
        store, slopes = tape.filled(values, seeds)
        n, count = len(time), len(self.outputs)
        shown = np.empty((n, count))
        shown_slopes = np.empty((n, count, len(seeds)))
        states = np.empty((n, len(self.states)))
        steps = integrate(
            tape.first,
            tape.codes,
            tape.left,
            tape.right,
            tape.begin,
            store,
            slopes,
            tape.clock,
            tape.states,
            tape.starts,
            tape.rates,
            tape.lows,
            tape.highs,
            tape.afters,
            tape.inputs,
            np.ascontiguousarray(held, dtype=np.bool_),
            tape.outputs,
            np.ascontiguousarray(time, dtype=float),
            np.ascontiguousarray(inputs, dtype=float),
            shown,
            shown_slopes,
            states,
        )
        if steps < 0:
            raise RanAway
        return Course(shown, shown_slopes, states, steps)


class _Tape:
    """The arrays of the integrator: operations that no state, input or time reaches come first."""

    def __init__(self, balances: Balances) -> None:
        plan = balances.plan.narrowed()
        place = {name: i for i, name in enumerate(plan.inputs)}
        moving = {place[n] for n in (*balances.states, *balances.inputs, TIME) if n in place}
        self.first = plan.first_operation
        still, moved = [], []
        for i, (name, a, b) in enumerate(plan.operations, self.first):
            operands = (a,) if name in UNARY else (a, b)
            if moving.intersection(operands):
                moving.add(i)
                moved.append(i)
            else:
                still.append(i)
        number = {i: i for i in range(self.first)}
        number |= {i: self.first + j for j, i in enumerate([*still, *moved])}
        operations = [plan.operations[i - self.first] for i in (*still, *moved)]
        self.codes = np.array([CODES[name] for name, _, _ in operations], dtype=np.int64)
        self.left = np.array([number[a] for _, a, _ in operations], dtype=np.int64)
        self.right = np.array(
            [number[a if name in UNARY else b] for name, a, b in operations], dtype=np.int64
        )
        self.begin = len(still)
        # States and inputs that nothing reads still need a slot to be written to.
        spare = self.first + len(operations)
        absent = [n for n in (*balances.states, *balances.inputs) if n not in place]
        slot = {**place, **{name: spare + i for i, name in enumerate(absent)}}
        self.size = spare + len(absent)
        self.clock = place.get(TIME, -1)

        def at(names: Sequence[str], found: Mapping[str, int]) -> Slots:
            return np.array([found.get(name, -1) for name in names], dtype=np.int64)

        outputs = {name: number[i] for name, i in plan.outputs.items()}
        self.states = at(balances.states, slot)
        self.inputs = at(balances.inputs, slot)
        self.starts = at([f"start:{s}" for s in balances.states], outputs)
        self.rates = at([f"der:{s}" for s in balances.states], outputs)
        self.lows = at([f"low:{s}" for s in balances.states], outputs)
        self.highs = at([f"high:{s}" for s in balances.states], outputs)
        self.afters = at([f"after:{s}" for s in balances.states], outputs)
        self.outputs = at(balances.outputs, outputs)
        self._parameters = place
        self._constants = np.array(plan.constants)
        self._inputs = len(plan.inputs)

    def filled(self, values: Mapping[str, float], seeds: Sequence[str]) -> tuple[Array, Array]:
        """Values and slopes with all that stays the same over a run filled in."""
        from rulec_runtime.simulation.integrator import evaluate

        store, slopes = np.zeros(self.size), np.zeros((self.size, len(seeds)))
        for name, i in self._parameters.items():
            store[i] = values.get(name, 0.0)
        store[self._inputs : self.first] = self._constants
        for column, name in enumerate(seeds):
            if name in self._parameters:
                slopes[self._parameters[name], column] = 1.0
        evaluate(
            self.first,
            self.codes[: self.begin],
            self.left,
            self.right,
            0,
            store,
            slopes,
            len(seeds),
        )
        return store, slopes
