"""Simulations of the models of one plant over one recording."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.robust_statistics import Flags
from rulec_runtime.simulation.balances import TIME, Balances, Course

from rulec.effects.candidate import BaseParameters, Candidate, Unknown
from rulec.effects.model_builder import ModelBuilder
from rulec.knowledge.parameter_belief import Belief, belief_in
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.stores.record import Record

SHOWN = "shown:"

Values = Mapping[str, float]


@dataclass(frozen=True)
class Simulated:
    """Simulated readings per measured signal, shape (n,), SI.

    `slopes` are derivatives by the seeds, shape (n, seeds); `course` has all states and outputs.
    """

    shown: Mapping[str, Array]
    slopes: Mapping[str, Array]
    course: Course

    @property
    def stacked(self) -> Array:
        """Readings of all signals one below the other, shape (signals * samples,), SI."""
        return np.concatenate(list(self.shown.values()))


class SimulationProblem:
    """A plant, its candidates, and a recording."""

    def __init__(self, ruleset: Ruleset, builder: ModelBuilder, record: Record) -> None:
        self.ruleset, self.builder, self.record = ruleset, builder, record
        self.signals = tuple(record.measured)
        self._beliefs: dict[tuple[str, ...], Belief] = {}
        self.time: Array = record.time - record.time[0]
        # Noise and fits use open samples; a reading at the end of its range counts.
        self.known: Mapping[str, Flags] = {
            n: np.isfinite(v) & record.open for n, v in record.measured.items()
        }

    @cached_property
    def _lines(self) -> frozenset[str]:
        """Inputs that are linear between samples."""
        return frozenset(s.id for s in self.ruleset.signals if s.between == "line")

    @property
    def base(self) -> BaseParameters:
        """Parameters of the plain plant."""
        return self.builder.parameters

    def belief(self, names: tuple[str, ...]) -> Belief:
        """The prior of some parameters of the plain plant."""
        if names not in self._beliefs:
            base = self.base
            place = {n: i for i, n in enumerate(base.ids)}
            rows = [place[n] for n in names]
            self._beliefs[names] = belief_in(
                names,
                base.positive[rows],
                base.values[rows],
                base.covariance[np.ix_(rows, rows)],
                base.sheet,
            )
        return self._beliefs[names]

    def ends(self, unknown: Unknown) -> tuple[float, float]:
        """Range of an unknown. Near the ends of a recording, an onset cannot be distinguished from
        a permanent effect, or from none."""
        if unknown.driver != TIME:
            return unknown.lowest, unknown.highest
        duration = float(self.time[-1])
        return limits.EDGE * duration, (1.0 - limits.EDGE) * duration

    def balances(self, joined: tuple[str, ...]) -> Balances:
        """The balances with candidates built in."""
        return self.builder.balances(joined)

    def free(self, joined: Sequence[Candidate]) -> tuple[str, ...]:
        """Free parameters of a fit: uncertain ones that affect a measured reading, and unknowns."""
        reached = self._reached(tuple(c.id for c in joined))
        known = [n for n in self.base.ids if n in reached]
        return (*known, *(u.id for c in joined for u in c.unknowns if not u.fixed))

    def _reached(self, joined: tuple[str, ...]) -> Collection[str]:
        """Plan inputs that affect a state or a measured reading."""
        plan, shown = self.balances(joined).plan, [f"{SHOWN}{n}" for n in self.signals]
        moving = ("der:", "start:", "low:", "high:", "after:")
        watched = [n for n in plan.outputs if n.startswith(moving) or n in shown]
        return plan.select(watched).used_inputs

    @cached_property
    def plain_values(self) -> dict[str, float]:
        """Values of all parameters of the plain plant, SI."""
        base = self.base
        return {**base.constants, **dict(zip(base.ids, base.values.tolist(), strict=True))}

    def simulate(
        self,
        joined: tuple[str, ...],
        values: Values,
        seeds: Sequence[str] = (),
        inputs: Mapping[str, Array] | None = None,
        spots: tuple[str, ...] = (),
    ) -> Simulated:
        """Simulate the whole recording, or with other `inputs`; raises `RanAway`.

        Errors at `spots` are inputs by their unknowns. `inputs` have shape (n,), SI.
        """
        whole = self.builder.balances(joined, spots)
        given = self.record.inputs if inputs is None else inputs
        table = np.column_stack([given[n] for n in whole.inputs] or [np.zeros((len(self.time), 0))])
        held = np.array([n not in self._lines for n in whole.inputs], dtype=np.bool_)
        course = whole.run(self.time, table, held, {**self.plain_values, **values}, seeds)
        shown, slopes = {}, {}
        for name in self.signals:
            i, (low, high) = whole.outputs.index(f"{SHOWN}{name}"), self._ends[name]
            own = course.shown[:, i]
            inside = (own > low) & (own < high)
            # A sensor shows nothing beyond its range.
            shown[name] = np.asarray(np.clip(own, low, high))
            slopes[name] = np.where(inside[:, None], course.slopes[:, i, :], 0.0)
        return Simulated(shown, slopes, course)

    @cached_property
    def _ends(self) -> dict[str, tuple[float, float]]:
        """Range of each sensor, extended to its readings."""
        found = {}
        for name, own in self.record.measured.items():
            signal = self.ruleset.signal_by_id[name]
            low = -np.inf if signal.lowest is None else min(signal.lowest, float(np.nanmin(own)))
            high = np.inf if signal.highest is None else max(signal.highest, float(np.nanmax(own)))
            found[name] = low, high
        return found

    def trajectory(
        self, joined: tuple[str, ...], values: Values, name: str, inputs: Mapping[str, Array]
    ) -> Array:
        """Course of an input, of time, or of a simulated state, flow or reading, shape (n,), SI."""
        if name == TIME:
            return self.time
        if name in inputs:
            return np.asarray(inputs[name])
        whole = self.balances(joined)
        course = self.simulate(joined, values, inputs=inputs).course
        if name in whole.states:
            return np.ascontiguousarray(course.states[:, whole.states.index(name)])
        module, _, end = name.partition(".")
        output = f"{SHOWN}{name}" if f"{SHOWN}{name}" in whole.outputs else f"{end}:{module}"
        return np.ascontiguousarray(course.shown[:, whole.outputs.index(output)])

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """Candidates with all parameters affecting measured readings; without a common clock, only
        those that do not follow time."""
        found = []
        for candidate in self.builder.candidates:
            if self.record.timed or not candidate.follows_time:
                reached = self._reached((candidate.id,))
                if all(u.id in reached for u in candidate.unknowns if not u.fixed):
                    found.append(candidate)
        return tuple(found)

    def candidate(self, name: str) -> Candidate:
        """A candidate by id."""
        return next(c for c in self.builder.candidates if c.id == name)


def unknowns_of(joined: Sequence[Candidate]) -> dict[str, Unknown]:
    """All unknowns by id."""
    return {u.id: u for c in joined for u in c.unknowns}
