"""How well readings of a plant that stores agree with a simulation of its plain model.

Errors of a simulation persist, so a block of the recording counts as one comparison per reading.

Source: own derivation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.failing_sensors import median_u
from rulec.mismatch.evidence.stores.fit import Fitter, Judged
from rulec.mismatch.evidence.stores.noise import Noise, drift_of
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem, record_of
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.agreement import Agreement, Compared
from rulec.mismatch.structure.clock_offset import (
    Shift,
    longest,
    nearest,
    pace_of,
    sizes_of,
    taken_of,
)
from rulec.mismatch.structure.hypotheses import AcceptedHypothesis

# Columns of a plant that stores with a wrong clock, where no plant behaves like that.
#
# A late reading may have a dead time, and a flow with a late effect a transport time: the
# catalogue has entries for both, and the search for physics handles them. A reading that answers
# before its cause, and a flow that acts before it exists, have a wrong clock.

Judge = Callable[[Recording, int], Agreement]
"""How well a recording agrees with the plain model, refitted in a number of steps."""


def shifts_against_cause(
    recording: Recording, ruleset: Ruleset, judge: Judge
) -> tuple[list[Shift], int]:
    """Shifts of single columns that agree better, and the number tried."""
    dynamics = ruleset.dynamics
    assert dynamics is not None
    plain = judge(recording, limits.STRUCTURE_STEPS)
    # Less than two samples of a simulation hardly show in it.
    least = 2 * -(-len(recording) // common.SAMPLE_BUDGET)
    sizes = [by for by in sizes_of(recording) if by >= least]
    if plain.gross < limits.GROSS_SHARE or not sizes:
        return [], 1
    before, pace = judge(recording, 0).likelihood, pace_of(recording)
    sides = dict.fromkeys(dynamics.inputs, 1) | dict.fromkeys(dynamics.outputs, -1)

    def read(name: str, by: int, steps: int) -> Agreement:
        return judge(Mending(signals=(name,), late=by * pace).of(recording), steps)

    def gain(name: str, by: int) -> float:
        return read(name, by, 0).likelihood - before

    best: dict[str, tuple[float, int]] = {}
    for name in (n for n in sides if n in recording.values):
        # A small part of the right shift improves the agreement; if it does not, none is tried.
        if gain(name, sides[name] * sizes[0]) > 0.0:
            best[name] = max((gain(name, sides[name] * by), sides[name] * by) for by in sizes)
    order = sorted((n for n in best if best[n][0] > 0.0), key=lambda n: -best[n][0])
    found = []
    for name in order[: limits.STRUCTURE_REFITTED]:
        by = nearest(partial(gain, name), best[name][1], longest(recording))
        # Effects after their cause are left to the catalogue.
        if by * sides[name] <= 0:
            continue
        # With the plain model refitted, one sample less or more may be better. Comparisons beyond
        # the ends of the file are no loss of the hypothesis.
        near = {at: read(name, at, limits.STRUCTURE_STEPS) for at in (by - 1, by, by + 1) if at}
        compared = {at: Compared(plain, replace(a, rows=plain.rows)) for at, a in near.items()}
        by = max(compared, key=lambda at: compared[at].gain)
        found.append(Shift(signals=(name,), by=by, gain=compared[by].gain, left=compared[by].left))
    return found, max(len(sizes) * len(best), 1)


@dataclass(frozen=True)
class Stores:
    """A plant that stores, judged by simulation."""

    ruleset: Ruleset
    builder: ModelBuilder
    heldout: Sequence[tuple[float, float]]

    def read(self) -> list[SignalSpec]:
        """Readings that the balances use or predict."""
        dynamics = self.ruleset.dynamics
        assert dynamics is not None
        used = {*dynamics.inputs, *dynamics.outputs}
        return [s for s in self.ruleset.signals if s.id in used]

    def agreement(self, recording: Recording, steps: int) -> Agreement:
        """How well a recording agrees with the plain model, refitted in `steps` steps."""
        record = record_of(recording, self.ruleset, self.builder.given, self.heldout)
        if record is None:
            return Agreement.none()
        problem = SimulationProblem(self.ruleset, self.builder, record)
        try:
            errors, penalty = _fitted(problem, steps)
        except RanAway:
            return Agreement.none()
        each = []
        for name in problem.signals:
            measured = record.measured[name]
            signal = self.ruleset.signal_by_id[name]
            of_class = median_u(signal, measured[np.isfinite(measured)])
            off = np.abs(errors[name][problem.counted[name]])
            off = off / np.hypot(problem.floors[name], of_class)
            off = np.where(np.isfinite(off), off, limits.UNREAD)
            each.append((np.log(np.maximum(off, 1.0)).mean(), (off > limits.GROSSLY_OFF).mean()))
        excess, gross = np.mean(each, axis=0).tolist()
        dynamics = self.ruleset.dynamics
        assert dynamics is not None
        shown = [n for n in dynamics.outputs if n in recording.values]
        return Agreement(
            rows=sum(int(flags.sum()) for flags in problem.counted.values()),
            count=float(common.BLOCKS * len(problem.signals)) * float(record.open.mean()),
            likelihood=-excess,
            excess=excess,
            gross=gross,
            penalty=penalty,
            idle=any(n not in problem.signals for n in shown),
        )

    def clock(self, recording: Recording) -> AcceptedHypothesis | None:
        """Columns with a wrong clock, if any."""
        shifts, tried = shifts_against_cause(recording, self.ruleset, self.agreement)
        return taken_of(shifts, tried, recording, self.ruleset, limits.STRUCTURE_LEAVES)


def _fitted(problem: SimulationProblem, steps: int) -> tuple[Mapping[str, Array], float]:
    """Errors beyond those of sensors within their class, shape (n,), SI, and the strain."""
    fitter = Fitter(problem, (), {})
    at = fitter.vector({})
    drift = drift_of(problem, fitter.values(at))
    noise = {
        n: Noise(limits.STRUCTURE_SCATTER * float(np.nanstd(v)) + 1e-12, 1.0)
        for n, v in problem.record.measured.items()
    }
    judged = Judged(problem.counted, noise, drift, np.zeros(drift.count))
    if not steps:
        return fitter.errors(at, judged)[0], 0.0
    fitted = fitter.finish(at, judged, steps, limits.STRUCTURE_ROUNDS)
    far = (fitter.vector(fitted.values) - at) / fitter.scale
    if 0.5 * float(far @ far) > limits.STRAINED:
        # Implausible parameters may compensate a wrong column: that is no agreement.
        return fitter.errors(at, judged)[0], 0.0
    return fitted.errors, fitted.negative_log_prior
