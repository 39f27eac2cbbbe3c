"""Fits of plants that store to convergence, with sensor errors linearised again and the memory of
errors taken into account."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.simulation.balances import TIME, RanAway

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.stores.drift import drift_of, moved_again, no_drift
from rulec.mismatch.evidence.stores.fit import Fitted, Fitter, Judged
from rulec.mismatch.evidence.stores.noise import Noise, gain
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem


@dataclass(frozen=True)
class FinalFits:
    """Fits models of a plant to convergence, with the weights of samples in `judged`."""

    bench: SimulationProblem
    judged: Judged

    @property
    def samples(self) -> dict[str, int]:
        """Number of samples that count, per signal."""
        return {n: int(k.sum()) for n, k in self.judged.known.items()}

    def news(self, fitted: Fitted) -> float:
        """Effective number of independent samples, by the residuals of a model."""
        return sum(self.samples[n] / noise.memory for n, noise in fitted.noise.items())

    def gain(self, after: Fitted, before: Fitted) -> float:
        """Gain in log likelihood over another model, less the price of additional values.

        Source: Schwarz 1978.
        """
        found = sum(gain(before.noise[n], after.noise[n], self.samples[n]) for n in before.noise)
        found += before.negative_log_prior - after.negative_log_prior
        each = 0.5 * float(np.log(max(self.news(after), 2.0)))
        more = [sum(not u.fixed for c in f.joined for u in c.unknowns) for f in (after, before)]
        return found - each * (more[0] - more[1])

    def fitted(
        self, joined: Sequence[Candidate], values: Mapping[str, float], near: Fitted
    ) -> Fitted:
        """Fit a model from some values, SI by id; `near` is a similar model."""
        fixed = {u.id for c in joined for u in c.unknowns if u.fixed}
        fitter = Fitter(self.bench, tuple(joined), {n: v for n, v in values.items() if n in fixed})
        there = fitter.values(fitter.vector(values))
        return self.polished(replace(near, joined=tuple(joined), values=there))

    def polished(self, fitted: Fitted) -> Fitted:
        """Fit a model to convergence, or as far as it does not run away."""
        fitter = Fitter(self.bench, fitted.joined, fixed_values(fitted))
        judged = replace(self.judged, noise=fitted.noise, slow=fitted.slow, drift=fitted.drift)
        for _ in range(limits.POLISHES):
            with contextlib.suppress(RanAway):
                drift = moved_again(
                    judged.drift, self.bench, fitted.ids, fitted.values, fitted.inputs
                )
                judged = replace(judged, drift=drift)
            try:
                fitted = fitter.finish(fitter.vector(fitted.values), judged, common.THOROUGH, 2)
            except RanAway:
                return fitted
            judged = replace(judged, noise=fitted.noise, slow=fitted.slow)
        return fitted

    def sharpened(self, fitted: Fitted) -> Fitted:
        """The same model with onsets shorter than a sample, if that fits as well.

        A search by slopes needs a rise of several samples. Where readings change by many times
        their noise within one sample, that smooth rise is an error, and would bias degrees.
        """
        # The rise of an entry with an onset is a share of its fixed time.
        share = min(limits.SUDDEN / len(self.bench.time), 1.0)
        lengths = {
            u.id: fitted.values[u.id] * share
            for c in fitted.joined
            if c.onset is not None
            for u in c.unknowns
            if u.fixed and u.driver == TIME
        }
        if not lengths:
            return fitted
        sharp = self.polished(replace(fitted, values={**fitted.values, **lengths}))
        return sharp if self.gain(sharp, fitted) > 0.0 else fitted


def plain_end(bench: SimulationProblem, values: Mapping[str, float]) -> tuple[FinalFits, Fitted]:
    """Fit the plain model from some values, and return it with what fits others beside it."""
    measured = bench.record.measured
    noise = {n: Noise(0.3 * float(np.nanstd(v)) + 1e-12, 10.0) for n, v in measured.items()}
    rough = Judged(bench.known, noise, no_drift(bench), np.zeros(0))
    fitter = Fitter(bench, (), {})
    first = fitter.finish(fitter.vector(values), rough, common.THOROUGH, 2)
    drift = drift_of(bench, (), first.values)
    ends = FinalFits(bench, Judged(bench.known, first.noise, drift, np.zeros(drift.count)))
    return ends, ends.polished(replace(first, slow=ends.judged.slow, drift=drift))


def fixed_values(fitted: Fitted) -> dict[str, float]:
    """Values of the fixed parameters of a model, SI by id."""
    fixed = {u.id for c in fitted.joined for u in c.unknowns if u.fixed}
    return {n: v for n, v in fitted.values.items() if n in fixed}
