"""The equations that readings and flows of a plant must obey, as its ruleset holds them.

Each observer, with faults undone, gives the flow of its module; flows balance at junctions. The
compiler has ordered them into steps and eliminated the flows (rulec/passes/order_equations.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec, SimulationStep
from rulec_runtime.output.refusal import Refusal

DEGREE = "x:"
"""Prefix of a fault's degree among the inputs of a plan."""


class SimulationRefused(Refusal):
    """The plant cannot be simulated as requested; the message is for the user."""


def equations_of(ruleset: Ruleset) -> Equations:
    """The equations of a plant; raises `SimulationRefused` if it can only be diagnosed."""
    if ruleset.simulation.refused:
        raise SimulationRefused(ruleset.simulation.refused)
    return Equations(ruleset)


@dataclass(frozen=True)
class Equations:
    """As many independent equations as unknowns, in steps."""

    ruleset: Ruleset

    @property
    def given(self) -> tuple[str, ...]:
        """Ids of signals that are inputs, or that no equation determines."""
        return self.ruleset.simulation.given

    @cached_property
    def predicted(self) -> tuple[str, ...]:
        """Signals that follow from the others, in the order of the plant."""
        found = {name for step in self.ruleset.simulation.steps for name in step.readings}
        return tuple(s.id for s in self.ruleset.signals if s.id in found)

    @cached_property
    def flows(self) -> tuple[str, ...]:
        """Modules whose flow is calculated: those with observers."""
        return tuple(m for m in self.ruleset.modules if m in self.flow_scales)

    @cached_property
    def given_signals(self) -> tuple[SignalSpec, ...]:
        """The signals in `given`."""
        return tuple(self.ruleset.signal_by_id[name] for name in self.given)

    @cached_property
    def flow_scales(self) -> Mapping[str, float]:
        """Size of each flow, m3/s: the mean of its estimates at the reference point."""
        sizes: dict[str, list[float]] = {}
        for observer in self.ruleset.observers:
            sizes.setdefault(observer.module, []).append(abs(observer.reference))
        means = {name: float(np.mean(s)) for name, s in sizes.items()}
        largest = max(means.values(), default=0.0) or 1.0
        return {name: mean or largest for name, mean in means.items()}

    @cached_property
    def reference(self) -> Mapping[str, float]:
        """Readings, SI, and flows, m3/s, at the reference point."""
        return {s.id: s.reference for s in self.ruleset.signals} | dict(self.flow_scales)

    @cached_property
    def steps(self) -> tuple[StepEquations, ...]:
        """The steps in order, each with what it needs from earlier ones."""
        return tuple(self._step(step) for step in self.ruleset.simulation.steps)

    def _step(self, step: SimulationStep) -> StepEquations:
        sums = (*step.zeros, *step.flows.values())
        terms = dict.fromkeys(name for part in sums for name in part)
        observers = tuple(name for name in terms if name in self.ruleset.observer_by_id)
        others = tuple(name for name in terms if name not in observers)
        plan = self.ruleset.undo.select(f"q:{name}" for name in observers).narrowed()
        order = (*observers, *others)
        modules = [*(self.ruleset.observer_by_id[name].module for name in observers), *others]
        zeros = _rows(step.zeros, order)
        # Each sum in units of the largest flow in it.
        size = [self.flow_scales[name] for name in modules]
        zeros /= (np.abs(zeros) * size).max(axis=1, initial=0.0)[:, None]
        signals = [self.ruleset.signal_by_id[name] for name in step.readings]
        scales = np.array([abs(s.reference - s.offset) or s.full_scale or 1.0 for s in signals])
        return StepEquations(
            readings=step.readings,
            flows=tuple(step.flows),
            observers=observers,
            plan=plan,
            known_flows=others,
            known_readings=tuple(
                n for n in plan.inputs if n not in step.readings and not n.startswith(DEGREE)
            ),
            zeros=zeros,
            sums=_rows(tuple(step.flows.values()), order),
            scales=scales,
            start=np.array([s.reference for s in signals]) / scales,
            flow_scales=np.array([self.flow_scales[name] for name in step.flows]),
        )


@dataclass(frozen=True, kw_only=True)
class StepEquations:
    """Equations that are solved together.

    Attributes
    ----------
    readings, flows : the unknowns.
    observers, plan : the estimates needed, and how they follow from readings and degrees.
    known_flows, known_readings : found by earlier steps, or given by the user.
    zeros : shape (readings, observers + known flows); sums of these that must vanish.
    sums : shape (flows, observers + known flows); the flows as sums of these.
    scales : size of each reading, SI: what its sensor shows at the reference point.
    start : the reference point in units of the scales.
    flow_scales : size of each flow, m3/s.
    """

    readings: tuple[str, ...]
    flows: tuple[str, ...]
    observers: tuple[str, ...]
    plan: Plan
    known_flows: tuple[str, ...]
    known_readings: tuple[str, ...]
    zeros: Array
    sums: Array
    scales: Array
    start: Array
    flow_scales: Array

    @cached_property
    def terms(self) -> tuple[tuple[int, int, float], ...]:
        """Row, observer and factor of every estimate in `zeros`."""
        rows, columns = np.nonzero(self.zeros[:, : len(self.observers)])
        factors = self.zeros[rows, columns]
        return tuple(zip(rows.tolist(), columns.tolist(), factors.tolist(), strict=True))


def _rows(sums: tuple[Mapping[str, float], ...], order: tuple[str, ...]) -> Array:
    rows = [[part.get(name, 0.0) for name in order] for part in sums]
    return np.array(rows).reshape(len(sums), len(order))
