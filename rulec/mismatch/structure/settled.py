"""How well readings at settled points agree, and whether they agree far better if read otherwise.

Source: own derivation. Points of one operating state count as one, as many samples of few states
are little evidence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.steady.redundancy import patterns_of, residual_basis
from rulec_runtime.recordings.recording import Recording

from rulec.effects.model_builder import ModelBuilder
from rulec.language.diagnostics import Refused
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.operating_state_means import states_of
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import rows_of
from rulec.mismatch.evidence.steady.screen import screen
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.agreement import Agreement
from rulec.mismatch.structure.clock_offset import moving_of, shifts_of, taken_of
from rulec.mismatch.structure.hypotheses import AcceptedHypothesis, Rewiring, rewirings


@dataclass(frozen=True)
class Comparable:
    """The possible comparisons of a settled point, `each`, and of all points, `rows`."""

    each: int
    rows: int


@dataclass(frozen=True)
class Settled:
    """Settled points of a plant, judged by their redundancy."""

    ruleset: Ruleset
    builder: ModelBuilder
    heldout: Sequence[tuple[float, float]]
    _fits: dict[int, tuple[Recording, Fitted]] = field(
        default_factory=dict, compare=False, repr=False
    )

    def read(self) -> list[SignalSpec]:
        """Readings that some estimate needs."""
        used = {s for o in self.ruleset.observers for s in o.signals}
        return [s for s in self.ruleset.signals if s.id in used]

    def agreement(self, recording: Recording, steps: int) -> Agreement:
        """How well a recording agrees with the plain model, refitted in `steps` steps."""
        found = self._fitted(recording, steps)
        return Agreement.none() if found is None else self._agreement(found)

    def _agreement(self, fitted: Fitted) -> Agreement:
        rows = fitted.rows
        used = rows.system.data.open[rows.group_point]
        if not used.any():
            return Agreement.none()
        state = states_of(rows.system)[rows.group_point]
        visits = np.bincount(state[used], minlength=state.max() + 1)
        weight = used / np.maximum(visits[state], 1)
        excess = np.log(np.maximum(np.abs(fitted.residual), 1.0))
        gross = np.abs(fitted.residual) > limits.GROSSLY_OFF
        count = float(weight @ rows.group_rank)
        return Agreement(
            rows=int((rows.group_rank * used).sum()),
            count=count,
            likelihood=float(weight @ fitted.likelihood) / count,
            excess=float(weight @ rows.per_group(excess)) / count,
            gross=float(weight @ rows.per_group(gross.astype(float))) / count,
            penalty=fitted.negative_log_prior,
            idle=bool((rows.system.valid.mean(axis=1) < limits.HARDLY_USED).any()),
        )

    def _fitted(self, recording: Recording, steps: int) -> Fitted | None:
        """The plain model refitted to settled points; that of the last recording is cached."""
        last = self._fits.get(steps)
        if last is not None and last[0] is recording:
            return last[1]
        data = prepare(recording, self.ruleset, self.heldout)
        if data is None:
            return None
        rows = rows_of(System(self.ruleset, self.builder, data), Configuration())
        if not rows.groups:
            return None
        found = fit(rows, Configuration(), data.open, steps)
        self._fits[steps] = recording, found
        return found

    def clock(self, recording: Recording) -> AcceptedHypothesis | None:
        """Columns with a wrong clock, if any; a table of points has no time."""
        found = self._fitted(recording, limits.STRUCTURE_STEPS)
        data = None if found is None else found.rows.system.data
        if found is None or data is None or data.of_rows or len(data) < common.FEWEST_POINTS:
            return None
        moving = moving_of(recording, found.rows.system, found.setting)
        return taken_of(*shifts_of(moving), recording, self.ruleset) if moving else None

    def rewired(self, rewiring: Rewiring) -> Settled | None:
        """The same plant with other connections; None if the compiler refuses it."""
        plant = self.builder.network.plant
        try:
            ruleset, builder = self.builder.connected(rewiring.of(plant.connections))
        except Refused:
            return None
        return Settled(ruleset, builder, self.heldout)

    def comparable(self, recording: Recording) -> Comparable:
        """The possible comparisons if all settled readings could be read."""
        found = self._fitted(recording, 0)
        if found is None:
            return Comparable(0, 0)
        system, data = found.rows.system, found.rows.system.data
        recorded = {o.id for o in system.observers}
        rests = np.array(
            [
                np.full(len(data), o.id in recorded) & ~data.moving.get(o.module, False)
                for o in self.ruleset.observers
            ]
        )
        rows = sum(
            len(residual_basis(self.ruleset, flags)) * len(points)
            for flags, points in patterns_of(rests)
        )
        return Comparable(len(residual_basis(self.ruleset, np.any(rests, axis=1))), rows)

    def otherwise(self, recording: Recording) -> tuple[Rewiring, ...]:
        """Other possible connections, near contradictions."""
        found = self._fitted(recording, limits.STRUCTURE_STEPS)
        plant = self.builder.network.plant
        if found is None or not plant.connections:
            return ()
        observed, ruleset = found.rows.system.observed, self.ruleset
        with np.errstate(invalid="ignore", divide="ignore"):
            far = np.abs(observed.residuals) > limits.GROSSLY_OFF * observed.residual_u
        module = {o.id: o.module for o in ruleset.observers}
        # By module, the largest share of points at which one of its comparisons is grossly off.
        off: dict[str, float] = {}
        for residual, share in zip(ruleset.residuals, far.mean(axis=1).tolist(), strict=True):
            for name in {module[term.observer] for term in residual.terms}:
                off[name] = max(off.get(name, 0.0), share)
        return rewirings(plant, off, limits.MOST_REWIRINGS)

    def explained(
        self, recording: Recording, modules: Sequence[str]
    ) -> list[tuple[Agreement, int]]:
        """Agreement with each of the best explanations at some modules, and its unknowns."""
        fitted = self._fitted(recording, limits.STRUCTURE_STEPS)
        if fitted is None:
            return []
        system, result = fitted.rows.system, []
        own = [c for c in system.candidates if set(c.modules) & set(modules)]
        for trial in screen(fitted, own)[: limits.STRUCTURE_REFITTED]:
            setting = trial.joined_to(fitted.setting)
            there = fit(fitted.rows, setting, system.data.open, limits.STRUCTURE_RIVAL_STEPS)
            result.append((self._agreement(there), len(trial.values)))
        return result
