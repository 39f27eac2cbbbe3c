"""Balances ready to be integrated: a plan in the form that the integrator reads."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.simulation.tape import OF_STATES, TIME, Tape, tape_of

__all__ = ["TIME", "Balances", "Course", "RanAway"]


class RanAway(Exception):
    """A state grew beyond all bounds: the parameters make no sense."""


@dataclass(frozen=True)
class Course:
    """Solution of balances over a recording.

    `shown` holds outputs, shape (samples, outputs), `slopes` their derivatives by the seeds, shape
    (samples, outputs, seeds), `states` the states, shape (samples, states). `steps` counts the
    steps taken.
    """

    shown: Array
    slopes: Array
    states: Array
    steps: int


@dataclass(frozen=True)
class Balances:
    """A plan with states and readings by id, and the readings that are given.

    `outputs` are names of outputs of the plan, such as ``shown:lower.y``.
    """

    plan: Plan
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @cached_property
    def _plan(self) -> Plan:
        """What the integrator reads, alone: it runs every operation, step by step."""
        read = {f"{what}:{state}" for what in OF_STATES for state in self.states}
        outputs = (n for n in self.plan.outputs if n in read or n in self.outputs)
        return self.plan.selected(outputs).narrowed()

    @cached_property
    def _tape(self) -> tuple[Tape, int]:
        return tape_of(self._plan, self.states, self.inputs, self.outputs)

    def run(
        self,
        time: Array,
        inputs: Array,
        held: NDArray[np.bool_],
        values: Mapping[str, float],
        seeds: Sequence[str] = (),
    ) -> Course:
        """Integrate from the first sample to the last; raises `RanAway`.

        Parameters
        ----------
        time : shape (n,), s, rising.
        inputs : shape (n, inputs), SI, all finite.
        held : per input, whether it keeps its value until the next sample; else it is interpolated.
        values : per parameter a value, SI; absent ones count as 0.
        seeds : parameters by which the outputs are differentiated.
        """
        # Loading the integrator's compiler takes longer than reading a plant.
        from rulec_runtime.simulation.integrator import integrate

        tape, _ = self._tape
        outputs = np.empty((len(time), len(self.outputs), 1 + len(seeds)))
        states = np.empty((len(time), len(self.states)))
        steps = integrate(
            tape,
            np.ascontiguousarray(held, dtype=np.bool_),
            np.ascontiguousarray(time, dtype=float),
            np.ascontiguousarray(inputs, dtype=float),
            self._filled(values, seeds),
            outputs,
            states,
        )
        if steps < 0:
            raise RanAway
        shown, slopes = outputs[:, :, 0], outputs[:, :, 1:]
        return Course(shown.copy(), slopes.copy(), states, steps)

    def _filled(self, values: Mapping[str, float], seeds: Sequence[str]) -> Array:
        """Store of the integrator, with everything that is constant over a run filled in."""
        from rulec_runtime.simulation.integrator import evaluate

        (tape, size), plan = self._tape, self._plan
        store = np.zeros((size, 1 + len(seeds) + len(self.states)))
        store[: len(plan.inputs), 0] = [values.get(name, 0.0) for name in plan.inputs]
        store[len(plan.inputs) : tape.first, 0] = plan.constants
        for column, name in enumerate(seeds, 1):
            if name in plan.inputs:
                store[plan.inputs.index(name), column] = 1.0
        still = tape.codes[: tape.begin]
        evaluate(tape.first, still, tape.left, tape.right, 0, store, 1 + len(seeds))
        return store
