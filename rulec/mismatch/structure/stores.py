"""How well readings of a plant that stores agree with a simulation of its plain model.

Errors of a simulation persist, so a block of the recording counts as one comparison per reading.

Source: own derivation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.robust_statistics import white_noise
from rulec_runtime.recordings.stationary import systematic_u
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.stores.drift import drift_of
from rulec.mismatch.evidence.stores.fit import Fitter, Judged
from rulec.mismatch.evidence.stores.noise import Noise
from rulec.mismatch.evidence.stores.record import record_of
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.agreement import Agreement
from rulec.mismatch.structure.clock_offset import taken_of
from rulec.mismatch.structure.connections import Rewiring
from rulec.mismatch.structure.hypotheses import AcceptedHypothesis
from rulec.mismatch.structure.stored_clock import shifts_against_cause


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
            errors, strain = _fitted(problem, steps)
        except RanAway:
            return Agreement.none()
        each = [_comparison(self.ruleset, problem, name, errors[name]) for name in problem.signals]
        likelihood, excess, gross = np.mean(each, axis=0).tolist()
        dynamics = self.ruleset.dynamics
        assert dynamics is not None
        shown = [n for n in dynamics.outputs if n in recording.values]
        return Agreement(
            rows=sum(int(known.sum()) for known in problem.known.values()),
            count=float(common.BLOCKS * len(problem.signals)) * float(record.open.mean()),
            likelihood=likelihood,
            excess=excess,
            gross=gross,
            strain=strain,
            idle=any(n not in problem.signals for n in shown),
        )

    def clock(self, recording: Recording) -> AcceptedHypothesis | None:
        """Columns with a wrong clock, if any."""
        shifts, tried = shifts_against_cause(recording, self.ruleset, self.agreement)
        return taken_of(shifts, tried, recording, self.ruleset, limits.STRUCTURE_LEAVES)

    def connection(self, recording: Recording, columns: int) -> AcceptedHypothesis | None:
        """None: connections of a plant that stores are not doubted."""
        return None

    def rewired(self, rewiring: Rewiring) -> Stores | None:
        """None: see `connection`."""
        return None


def _fitted(problem: SimulationProblem, steps: int) -> tuple[Mapping[str, Array], float]:
    """Errors beyond those of sensors within their class, shape (n,), SI, and the strain."""
    fitter = Fitter(problem, (), {})
    at = fitter.vector({})
    drift = drift_of(problem, (), fitter.values(at))
    noise = {
        n: Noise(limits.STRUCTURE_SCATTER * float(np.nanstd(v)) + 1e-12, 1.0)
        for n, v in problem.record.measured.items()
    }
    judged = Judged(problem.known, noise, drift, np.zeros(drift.count))
    if not steps:
        return fitter.errors(at, judged)[0], 0.0
    fitted = fitter.finish(at, judged, steps, limits.STRUCTURE_ROUNDS)
    far = (fitter.vector(fitted.values) - at) / fitter.scale
    if 0.5 * float(far @ far) > limits.STRAINED:
        # Implausible parameters may compensate a wrong column: that is no agreement.
        return fitter.errors(at, judged)[0], 0.0
    return fitted.errors, fitted.negative_log_prior


def _comparison(
    ruleset: Ruleset, problem: SimulationProblem, name: str, error: Array
) -> tuple[float, float, float]:
    """Means of the log likelihood of an error, the log of its size, and whether it is gross."""
    measured = problem.record.measured[name]
    finite = measured[np.isfinite(measured)]
    u = systematic_u(ruleset.signal_by_id[name], finite)
    of_class = float(np.median(np.broadcast_to(u, finite.shape)))
    noise = max(white_noise(np.diff(finite, 3), 3), problem.record.resolution[name])
    off = np.abs(error[problem.known[name]]) / np.hypot(noise, of_class)
    off = np.where(np.isfinite(off), off, limits.UNREAD)
    excess = np.log(np.maximum(off, 1.0))
    return -float(excess.mean()), float(excess.mean()), float((off > limits.GROSSLY_OFF).mean())
