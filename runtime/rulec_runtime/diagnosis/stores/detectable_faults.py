"""Which faults of a plant that stores its readings can show: the balances simulated once.

Inputs swing around their reference, so that every fault has a characteristic course; sensors have
no noise but their resolution. A fault is detectable by what initial states and lasting errors
cannot explain of it.
"""

from collections.abc import Mapping, Set
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Dynamics, Ruleset
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.errors import lasting_errors
from rulec_runtime.diagnosis.stores.free_balances import nominal_starts
from rulec_runtime.diagnosis.stores.window_fit import Guess, Model, inverse
from rulec_runtime.diagnosis.stores.windows import Window
from rulec_runtime.recordings.stationary import systematic_u
from rulec_runtime.simulation.balances import RanAway


@dataclass(frozen=True)
class StoresSighted:
    """Slopes of the outputs, in standard deviations, by initial states, `errors` and degrees: shape
    (samples, outputs, unknowns). None if the balances cannot be simulated; then every fault counts
    as detectable while all inputs and some output are there."""

    ruleset: Ruleset
    slopes: Array | None
    errors: int
    known: dict[frozenset[str], Array] = field(default_factory=dict)

    @cached_property
    def signals(self) -> frozenset[str]:
        return frozenset((*self._dynamics.inputs, *self._dynamics.outputs))

    @cached_property
    def highest(self) -> Mapping[str, float]:
        return {name: self.ruleset.fault_by_id[name].highest for name in self._dynamics.faults}

    @property
    def _dynamics(self) -> Dynamics:
        assert self.ruleset.dynamics is not None
        return self.ruleset.dynamics

    def information(self, lost: Set[str], still: Set[str] = frozenset()) -> Array:
        """See `Sighted`; balances hold at standstill as well."""
        key = frozenset(lost)
        if key not in self.known:
            self.known[key] = self._information(key)
        return self.known[key]

    def _information(self, lost: frozenset[str]) -> Array:
        there = [i for i, name in enumerate(self._dynamics.outputs) if name not in lost]
        faults = self._dynamics.faults
        if not lost.isdisjoint(self._dynamics.inputs) or not there:
            return np.zeros((len(faults), len(faults)))
        if self.slopes is None:
            return np.diag(np.full(len(faults), np.inf))
        table = self.slopes[:, there].reshape(-1, self.slopes.shape[2])
        own, effect = np.split(table, [table.shape[1] - len(faults)], axis=1)
        certain = own.T @ own
        starts = len(certain) - self.errors
        certain[starts:, starts:] += np.eye(self.errors)
        shared = own.T @ effect
        whole = effect.T @ effect
        left: Array = whole - shared.T @ inverse(certain) @ shared
        shown = np.diag(left) > limits.HIDDEN_EFFECT * np.diag(whole)
        return np.where(np.outer(shown, shown), left, 0.0)


def sighted(ruleset: Ruleset) -> StoresSighted:
    """Simulate the balances of a plant from their nominal start."""
    dynamics = ruleset.dynamics
    assert dynamics is not None
    signals = [ruleset.signal_by_id[name] for name in dynamics.outputs]
    level = np.array([signal.reference for signal in signals])
    spread = np.array([common.NO_CHANGE * float(systematic_u(s, s.reference)) for s in signals])
    spread = np.where(spread > 0.0, spread, 1.0)
    model = Model.of(ruleset, (), spread)
    errors = lasting_errors(ruleset, model.balances.plan.used_inputs, level)
    model = Model.of(ruleset, errors, spread)
    guess = Guess(nominal_starts(dynamics), np.zeros(len(errors)), np.zeros(len(dynamics.faults)))
    try:
        _, slopes, _ = model.simulate(swinging(ruleset, dynamics), guess, dynamics.faults)
    except RanAway:
        return StoresSighted(ruleset, None, len(errors))
    return StoresSighted(ruleset, slopes / spread[:, None], len(errors))


def swinging(ruleset: Ruleset, dynamics: Dynamics) -> Window:
    """A window without readings in which each input swings at a pace of its own."""
    n = limits.SIGNATURE_SAMPLES
    time: Array = np.arange(n, dtype=np.float64) * limits.SIGNATURE_STEP
    levels = [ruleset.signal_by_id[name].reference for name in dynamics.inputs]
    paces = [limits.SIGNATURE_PACE + limits.SIGNATURE_PACES_APART * i for i in range(len(levels))]
    courses = [
        v * (1.0 + limits.SIGNATURE_SWING * np.sin(time / p))
        for v, p in zip(levels, paces, strict=True)
    ]
    inputs = np.column_stack(courses) if courses else np.zeros((n, 0))
    blank = np.zeros((n, len(dynamics.outputs)))
    return Window(time=time, inputs=inputs, measured=blank, piece=0, first=0, because="")
