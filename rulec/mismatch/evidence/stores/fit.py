"""Fit a model to the open samples of a recording: simulation errors, priors, bounds, noise.

Source: trust region with bounds (Branch, Coleman, Li 1999; scipy); slow errors of inputs are
eliminated by projection (variable projection: Golub, Pereyra 1973).
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust_statistics import Flags
from rulec_runtime.simulation.balances import TIME, RanAway

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.prior import step_of
from rulec.mismatch.evidence.stores.noise import (
    Drift,
    Noise,
    drift_of,
    gain,
    moved_again,
    no_drift,
    noise_of,
)
from rulec.mismatch.evidence.stores.simulation_problem import (
    Simulated,
    SimulationProblem,
    unknowns_of,
)


@dataclass(frozen=True)
class Judged:
    """Which samples are `counted`, and their `noise`, per signal.

    `drift` has the effects of sensor errors within their class, which no model has to explain;
    `slow` are those of inputs in a simulation, in their uncertainties, shape (errors of `drift`,).
    """

    counted: Mapping[str, Flags]
    noise: Mapping[str, Noise]
    drift: Drift
    slow: Array

    @cached_property
    def flags(self) -> Flags:
        """Flags of samples that count, all signals stacked."""
        return np.concatenate(list(self.counted.values()))

    @cached_property
    def weights(self) -> Array:
        """Divisors of errors, shape (signals * samples,), stacked alike."""
        return np.concatenate(
            [np.full(len(k), self.noise[n].weight) for n, k in self.counted.items()]
        )

    @cached_property
    def samples(self) -> dict[str, int]:
        """Number of samples that count, per signal."""
        return {n: int(k.sum()) for n, k in self.counted.items()}

    @cached_property
    def basis(self) -> Array:
        """Orthonormal columns that span slow errors and their priors, shape (samples that count +
        errors, errors)."""
        if not self.drift.count:
            return np.zeros((int(self.flags.sum()), 0))
        moved = (self.drift.moved / self.weights[:, None])[self.flags]
        basis, _ = np.linalg.qr(np.vstack([moved, np.eye(self.drift.count)]))
        return np.asarray(basis)


def independent(problem: SimulationProblem, noise: Mapping[str, Noise]) -> Judged:
    """All open samples, with the given noise and without errors of sensors."""
    return Judged(problem.counted, noise, no_drift(problem), np.zeros(0))


@dataclass(frozen=True)
class Fitted:
    """A model fitted to a recording, with the noise and the slow errors of inputs found.

    `values` has free and fixed parameters, SI, by id. `errors` are simulated less measured readings
    less the part explained by sensor errors, per signal, shape (n,). `negative_log_prior` includes
    that of sensor errors.
    """

    problem: SimulationProblem
    joined: tuple[Candidate, ...]
    values: Mapping[str, float]
    errors: Mapping[str, Array]
    negative_log_prior: float
    judged: Judged

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the joined candidates."""
        return tuple(c.id for c in self.joined)

    @property
    def noise(self) -> Mapping[str, Noise]:
        """The noise of each signal, estimated from its error."""
        return self.judged.noise

    @cached_property
    def inputs(self) -> Mapping[str, Array]:
        """Inputs corrected for slow errors, shape (n,), SI."""
        return self.judged.drift.put_right(self.problem.record.inputs, self.judged.slow)

    def course(self, name: str) -> Array:
        """Course of an input, of time, or of a simulated state, flow or reading, shape (n,), SI."""
        return self.problem.trajectory(self.ids, self.values, name, self.inputs)

    @cached_property
    def fitter(self) -> Fitter:
        """What fits this model."""
        return Fitter(self.problem, self.joined, self.values)

    @property
    def free(self) -> tuple[str, ...]:
        """Ids of the free parameters."""
        return self.fitter.free

    @property
    def at(self) -> Array:
        """Coordinates of the free parameters, shape (free,)."""
        return self.fitter.vector(self.values)

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the free parameters, SI, shape (free, free)."""
        fitter, prior, scale = self.fitter, self.fitter.prior, self.fitter.scale
        _, slopes = fitter.residual(self.at, self.judged)
        # A value that the data do not determine is uniform between its bounds.
        span = np.minimum(prior.highest - prior.lowest, limits.SPREAD_OUT * scale) / scale
        scaled = np.linalg.inv(slopes.T @ slopes + np.diag(12.0 / span**2))
        step = scale * prior.coordinates.slopes(self.at)
        return np.asarray(scaled * np.outer(step, step))

    def u(self, name: str) -> float:
        """Standard uncertainty of a parameter, SI."""
        i = self.free.index(name)
        return float(np.sqrt(max(self.covariance[i, i], 0.0)))

    def gain(self, before: Fitted, values: float | None = None) -> float:
        """Gain in log likelihood over another model, less the penalty of additional `values`: those
        that the recording determines, or else the number of unknowns.

        Source: Schwarz 1978.
        """
        samples, noise = self.judged.samples, self.noise
        found = sum(gain(before.noise[n], noise[n], samples[n]) for n in noise)
        found += before.negative_log_prior - self.negative_log_prior
        effective_size = sum(samples[n] / own.correlation_time for n, own in noise.items())
        if values is None:
            more = [sum(not u.fixed for c in f.joined for u in c.unknowns) for f in (self, before)]
            values = more[0] - more[1]
        return found - 0.5 * float(np.log(max(effective_size, 2.0))) * values


class Fitter:
    """Fits models with some candidates joined, whose fixed parameters are among `values`.

    A point `at`, shape (free,), has the coordinates of the free parameters: logarithms of positive
    ones of the plant, values, SI, of all others. `scale`, shape (free,), has a typical step of each
    coordinate.
    """

    def __init__(
        self, problem: SimulationProblem, joined: tuple[Candidate, ...], values: Mapping[str, float]
    ) -> None:
        self.problem, self.joined = problem, joined
        self.ids = tuple(c.id for c in joined)
        unknowns = unknowns_of(joined)
        self.fixed = {n: values[n] for n, unknown in unknowns.items() if unknown.fixed}
        nowhere = Configuration(joined=joined, values=dict.fromkeys(unknowns, 0.0))
        self.prior = prior = problem.prior(nowhere)
        self.free, self._count = prior.names, len(prior.belief.names)
        own = [unknowns[n] for n in self.free[self._count :]]
        edge = limits.EDGE * float(problem.time[-1])
        steps = [edge if one.driver == TIME else step_of(one) for one in own]
        self.scale = np.concatenate([prior.size[: self._count], steps])
        self._times = [i for i, one in enumerate(own, self._count) if one.driver == TIME]

    def clipped(self, at: Array) -> Array:
        """The nearest point within bounds."""
        return np.asarray(np.clip(at, self.prior.lowest, self.prior.highest))

    def vector(self, values: Mapping[str, float]) -> Array:
        """The point with values, SI, by id, within bounds; plain values where none are given."""
        return self.clipped(self.prior.of(values))

    def values(self, at: Array) -> dict[str, float]:
        """Free and fixed values, SI, by id."""
        return {**self.fixed, **self.prior.values(at)}

    def _simulate(self, at: Array, judged: Judged, *, slopes: bool) -> tuple[Array, Simulated]:
        """Simulated less measured readings, stacked, SI, NaN where nothing was measured; and the
        simulation."""
        seeds, record = self.free if slopes else (), self.problem.record
        inputs = judged.drift.put_right(record.inputs, judged.slow)
        model = self.problem.simulate(self.ids, self.values(at), seeds, inputs)
        return np.concatenate([model.shown[n] - v for n, v in record.measured.items()]), model

    def residual(self, at: Array, judged: Judged) -> tuple[Array, Array]:
        """Weighted errors and strains of the priors, and their slopes per scaled parameter."""
        errors, model = self._simulate(at, judged, slopes=True)
        flags, weights, count = judged.flags, judged.weights, self._count
        step = self.scale * self.prior.coordinates.slopes(at)
        slopes = [model.slopes[n] * step for n in self.problem.signals]
        columns = np.column_stack([errors, np.concatenate(slopes)])
        columns = _projected((columns / weights[:, None])[flags], judged.basis, judged.slow)
        strains, by_coordinates = self.prior.belief.strains(at[:count])
        of_prior = np.zeros((len(strains), len(self.free)))
        of_prior[:, :count] = by_coordinates * self.scale[:count]
        return (
            np.concatenate([columns[:, 0], strains]),
            np.concatenate([columns[:, 1:], of_prior]),
        )

    def as_rows(self, moved: Array, judged: Judged) -> Array:
        """Changes of readings, shape (signals * samples, columns), SI, as further columns of the
        slopes in `residual`."""
        columns = (moved / judged.weights[:, None])[judged.flags]
        columns = _projected(columns, judged.basis, np.zeros(judged.drift.count))
        return np.concatenate([columns, np.zeros((self.prior.belief.rows, columns.shape[1]))])

    def _prior_squares(self, at: Array) -> float:
        """Sum of the squares of the strains of the priors."""
        return float(np.sum(self.prior.belief.strains(at[: self._count])[0] ** 2))

    def cost(self, at: Array, judged: Judged) -> float:
        """Half the sum of squares; infinite where the model runs away."""
        try:
            errors, _ = self._simulate(at, judged, slopes=False)
        except RanAway:
            return float("inf")
        column = (errors / judged.weights)[judged.flags, None]
        total = float(np.sum(_projected(column, judged.basis, judged.slow) ** 2))
        return 0.5 * (total + self._prior_squares(at))

    def descend(
        self,
        at: Array,
        judged: Judged,
        evaluations: int,
        held: Mapping[int, float] | None = None,
    ) -> Array:
        """A local optimum near a point, with some coordinates `held`, by number."""
        from scipy.optimize import least_squares

        last: dict[bytes, tuple[Array, Array]] = {}

        def both(z: Array) -> tuple[Array, Array]:
            key = z.tobytes()
            if key not in last:
                last.clear()
                try:
                    last[key] = _compressed(*self.residual(z * self.scale, judged))
                except RanAway:
                    count = len(z) + 1
                    last[key] = (np.full(count, limits.RUNAWAY), np.zeros((count, len(z))))
            return last[key]

        low, high = self.prior.lowest.copy(), self.prior.highest.copy()
        for i, value in (held or {}).items():
            margin = 1e-7 * self.scale[i]
            low[i], high[i] = value - margin, value + margin
        low, high = low / self.scale, high / self.scale
        span = np.minimum(1e-9 * (1.0 + np.abs(low) + np.abs(high)), 1e-6)
        span = np.minimum(span, 0.25 * (high - low))
        # Steps that overflow are rejected.
        with np.errstate(all="ignore"):
            found = least_squares(
                lambda z: both(z)[0],
                np.clip(at / self.scale, low + span, high - span),
                jac=lambda z: both(z)[1],
                bounds=(low, high),
                max_nfev=evaluations,
                xtol=1e-6,
                ftol=1e-6,
                gtol=1e-6,
            )
        return np.asarray(found.x * self.scale)

    def fall(self, at: Array, i: int, step: float, along: Array, judged: Judged) -> float:
        """The least cost with one parameter held a step away; `along` has the linear response of
        the others.

        Values that only the priors distinguish form a ridge, which a descent beside it does not
        reach.
        """
        starts, held = (at + step * way for way in (0.0, along)), {i: float(at[i] + step)}
        near = [self.descend(start, judged, limits.HELD_EVALUATIONS, held) for start in starts]
        return min(self.cost(point, judged) for point in near)

    def errors(self, at: Array, judged: Judged) -> tuple[dict[str, Array], Array]:
        """Simulated less measured readings less the part that sensor errors explain, per signal,
        NaN where nothing was measured; and those sensor errors."""
        (whole, _), slow = self._simulate(at, judged, slopes=False), judged.slow
        if judged.drift.count:
            weights, flags = judged.weights, judged.flags
            moved = judged.drift.moved / weights[:, None]
            left = (whole / weights)[flags]
            normal = moved[flags].T @ moved[flags] + np.eye(len(slow))
            found = np.linalg.solve(normal, moved[flags].T @ left + slow)
            whole, slow = whole - judged.drift.moved @ found, slow - found
        signals = self.problem.signals
        return dict(zip(signals, np.split(whole, len(signals)), strict=True)), slow

    def fitted_at(self, at: Array, judged: Judged) -> Fitted:
        """The model at a point, with the noise and the slow errors of inputs as they are there."""
        errors, slow = self.errors(at, judged)
        least = self.problem.record.resolution
        noise = {n: noise_of(e, judged.counted[n], least[n]) for n, e in errors.items()}
        negative_log_prior = 0.5 * (self._prior_squares(at) + float(np.sum(slow**2)))
        judged = replace(judged, noise=noise, slow=judged.drift.given(slow))
        values = self.values(at)
        return Fitted(self.problem, self.joined, values, errors, negative_log_prior, judged)

    def finish(self, at: Array, judged: Judged, evaluations: int, rounds: int) -> Fitted:
        """Fit and estimate the noise in turn.

        Each time, other values are fitted again with the onsets held: errors have a kink where an
        onset passes a sample, at which steps of all values end.
        """
        for _ in range(rounds):
            at = self.descend(at, judged, evaluations)
            if self._times:
                held = {i: float(at[i]) for i in self._times}
                at = self.descend(at, judged, evaluations, held)
            fitted = self.fitted_at(at, judged)
            judged = fitted.judged
        return fitted


def _compressed(residual: Array, slopes: Array) -> tuple[Array, Array]:
    """One row more than parameters, with the same sum of squares, gradient and curvature.

    The optimiser needs a singular value decomposition at each point; that of all samples would cost
    more than their simulation.
    """
    count = slopes.shape[1]
    triangle: Array = np.asarray(np.linalg.qr(np.column_stack([slopes, residual]), mode="r"))
    return triangle[:, count].copy(), triangle[:, :count].copy()


def _projected(columns: Array, basis: Array, slow: Array) -> Array:
    """Columns, errors first, less the part that slow errors explain within their priors; `slow` are
    the current values of these."""
    extra = basis.shape[1]
    if not extra:
        return columns
    padded = np.vstack([columns, np.zeros((extra, columns.shape[1]))])
    padded[-extra:, 0] = slow
    return np.asarray(padded - basis @ (basis.T @ padded))


# Fits of plants that store to convergence, with sensor errors linearised again and the correlation
# of errors taken into account.


def plain_end(problem: SimulationProblem, values: Mapping[str, float]) -> Fitted:
    """Fit the plain model from some values."""
    measured = problem.record.measured
    noise = {n: Noise(0.3 * float(np.nanstd(v)) + 1e-12, 10.0) for n, v in measured.items()}
    fitter = Fitter(problem, (), {})
    first = fitter.finish(fitter.vector(values), independent(problem, noise), common.THOROUGH, 2)
    drift = drift_of(problem, first.values)
    judged = Judged(problem.counted, first.noise, drift, np.zeros(drift.count))
    return polished(replace(first, judged=judged))


def refit(near: Fitted, joined: Sequence[Candidate], values: Mapping[str, float]) -> Fitted:
    """Fit a model from some values, SI by id, and from the noise of a similar model."""
    fitter = Fitter(near.problem, tuple(joined), values)
    there = fitter.values(fitter.vector(values))
    return polished(replace(near, joined=tuple(joined), values=there))


def polished(fitted: Fitted) -> Fitted:
    """Fit a model to convergence, or as far as it does not run away."""
    for _ in range(limits.POLISHES):
        judged = fitted.judged
        with contextlib.suppress(RanAway):
            drift = moved_again(
                judged.drift, fitted.problem, fitted.ids, fitted.values, fitted.inputs
            )
            judged = replace(judged, drift=drift)
        try:
            fitted = fitted.fitter.finish(fitted.at, judged, common.THOROUGH, 2)
        except RanAway:
            break
    return fitted


def sharpened(fitted: Fitted) -> Fitted:
    """The same model with onsets shorter than a sample, if that fits as well.

    A search by slopes needs a rise of several samples. Where readings change by many times their
    noise within one sample, that smooth rise is an error, and would bias degrees.
    """
    # The rise of an entry with an onset is a share of its fixed time.
    share = min(limits.SUDDEN / len(fitted.problem.time), 1.0)
    begun = [u for c in fitted.joined if c.onset is not None for u in c.unknowns]
    lengths = {u.id: fitted.values[u.id] * share for u in begun if u.fixed and u.driver == TIME}
    if not lengths:
        return fitted
    sharp = polished(replace(fitted, values={**fitted.values, **lengths}))
    return sharp if sharp.gain(fitted) > 0.0 else fitted
