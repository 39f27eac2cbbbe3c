"""Fit a model to the open samples of a recording: simulation errors, priors, bounds, noise.

Source: trust region with bounds (Branch, Coleman, Li 1999; scipy); slow errors of inputs are
eliminated by projection (variable projection: Golub, Pereyra 1973).
"""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
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
class Fitted:
    """A model fitted to a recording.

    `values` has free and fixed parameters, SI, by id; `free` are the ids of those in `covariance`,
    shape (free, free). `errors` are simulated less measured readings less the part explained by
    sensor errors, per signal, shape (n,); `noise` is estimated from them. `negative_log_prior`
    includes that of sensor errors. `slow` are sensor errors within their class, in their
    uncertainties, `inputs` the inputs corrected for them, and `drift` has their effects.
    """

    joined: tuple[Candidate, ...]
    values: Mapping[str, float]
    free: tuple[str, ...]
    noise: Mapping[str, Noise]
    errors: Mapping[str, Array]
    negative_log_prior: float
    covariance: Array
    slow: Array
    inputs: Mapping[str, Array]
    drift: Drift

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the joined candidates."""
        return tuple(c.id for c in self.joined)

    def u(self, name: str) -> float:
        """Standard uncertainty of a parameter, SI."""
        i = self.free.index(name)
        return float(np.sqrt(max(self.covariance[i, i], 0.0)))


@dataclass(frozen=True)
class Judged:
    """Which samples count (`known`), and their `noise`, per signal.

    `slow` are the errors of inputs in a simulation, shape (errors of `drift`,).
    """

    known: Mapping[str, Flags]
    noise: Mapping[str, Noise]
    drift: Drift
    slow: Array

    @cached_property
    def flags(self) -> Flags:
        """Flags of samples that count, all signals stacked."""
        return np.concatenate(list(self.known.values()))

    @cached_property
    def weights(self) -> Array:
        """Divisors of errors, shape (signals * samples,), stacked alike."""
        return np.concatenate(
            [np.full(len(k), self.noise[n].weight) for n, k in self.known.items()]
        )

    @cached_property
    def basis(self) -> Array:
        """Orthonormal columns that span slow errors and their priors, shape (samples that count +
        errors, errors)."""
        if not self.drift.count:
            return np.zeros((int(self.flags.sum()), 0))
        moved = (self.drift.moved / self.weights[:, None])[self.flags]
        basis, _ = np.linalg.qr(np.vstack([moved, np.eye(self.drift.count)]))
        return np.asarray(basis)


class Fitter:
    """Fits models with some candidates joined.

    A point `at`, shape (free,), has the coordinates of the free parameters: logarithms of positive
    ones of the plant, values, SI, of all others. `scale`, shape (free,), has a typical step of each
    coordinate.
    """

    def __init__(
        self, bench: SimulationProblem, joined: tuple[Candidate, ...], fixed: Mapping[str, float]
    ) -> None:
        self.bench, self.joined, self.fixed = bench, joined, dict(fixed)
        self.ids = tuple(c.id for c in joined)
        unknowns = unknowns_of(joined)
        nowhere = Configuration(joined=joined, values=dict.fromkeys(unknowns, 0.0))
        self._prior = prior = bench.prior(nowhere)
        self.free, self._belief = prior.names, prior.belief
        self._count = len(prior.belief.names)
        self._unknowns = [unknowns[n] for n in self.free[self._count :]]
        edge = limits.EDGE * float(bench.time[-1])
        steps = [edge if one.driver == TIME else step_of(one) for one in self._unknowns]
        self.scale = np.concatenate([prior.size[: self._count], steps])
        self._low, self._high = prior.lowest, prior.highest

    def slopes(self, at: Array) -> Array:
        """Slopes of the values, SI, by the coordinates at a point, shape (free,)."""
        return self._prior.coordinates.slopes(at)

    def within(self, at: Array) -> Array:
        """The nearest point within bounds."""
        return np.asarray(np.clip(at, self._low, self._high))

    def vector(self, values: Mapping[str, float]) -> Array:
        """The point with values, SI, by id, within bounds; plain values where none are given."""
        return self.within(self._prior.of(values))

    def bounds(self, name: str) -> tuple[float, float]:
        """Bounds of an unknown of a candidate, SI."""
        i = self.free.index(name)
        return float(self._low[i]), float(self._high[i])

    def fall(self, at: Array, i: int, step: float, along: Array, judged: Judged) -> float:
        """The least cost with one parameter held a step away; `along` has the linear response of
        the others.

        Values that only the priors distinguish form a ridge, which a descent beside it does not
        reach.
        """
        value = at[i] + step
        with self._held({i: value}):
            starts = (self.within(at + step * a) for a in (0.0, along))
            near = [self.descend(start, judged, limits.HELD_EVALUATIONS) for start in starts]
            return min(self.cost(point, judged) for point in near)

    @contextlib.contextmanager
    def _held(self, values: Mapping[int, float]) -> Iterator[None]:
        """Hold some free values, by number."""
        low, high = self._low, self._high
        self._low, self._high = low.copy(), high.copy()
        for i, value in values.items():
            margin = 1e-7 * self.scale[i]
            self._low[i], self._high[i] = value - margin, value + margin
        try:
            yield
        finally:
            self._low, self._high = low, high

    def values(self, at: Array) -> dict[str, float]:
        """Free and fixed values, SI, by id."""
        return {**self.fixed, **self._prior.values(at)}

    def simulate(self, at: Array, judged: Judged, slopes: bool = True) -> Simulated:
        """Simulate the model at a point."""
        seeds = self.free if slopes else ()
        inputs = judged.drift.put_right(self.bench.record.inputs, judged.slow)
        return self.bench.simulate(self.ids, self.values(at), seeds, inputs)

    def _strains(self, at: Array) -> tuple[Array, Array]:
        return self._belief.strains(at[: self._count])

    def _errors_of(self, model: Simulated) -> Array:
        """Simulated less measured readings, stacked, SI; NaN where nothing was measured."""
        measured = self.bench.record.measured
        return np.concatenate([model.shown[n] - v for n, v in measured.items()])

    def residual(self, at: Array, judged: Judged) -> tuple[Array, Array]:
        """Weighted errors and strains of the priors, and their slopes per scaled parameter."""
        model = self.simulate(at, judged)
        flags, weights = judged.flags, judged.weights
        step = self.scale * self.slopes(at)
        slopes = [model.slopes[n] * step for n in self.bench.signals]
        columns = np.column_stack([self._errors_of(model), np.concatenate(slopes)])
        columns = _projected((columns / weights[:, None])[flags], judged.basis, judged.slow)
        strains, by_coordinates = self._strains(at)
        of_prior = np.zeros((len(strains), len(self.free)))
        of_prior[:, : self._count] = by_coordinates * self.scale[: self._count]
        return (
            np.concatenate([columns[:, 0], strains]),
            np.concatenate([columns[:, 1:], of_prior]),
        )

    def as_rows(self, moved: Array, judged: Judged) -> Array:
        """Changes of readings, shape (signals * samples, columns), SI, as further columns of the
        slopes in `residual`."""
        columns = (moved / judged.weights[:, None])[judged.flags]
        columns = _projected(columns, judged.basis, np.zeros(judged.drift.count))
        return np.concatenate([columns, np.zeros((self._belief.rows, columns.shape[1]))])

    def cost(self, at: Array, judged: Judged) -> float:
        """Half the sum of squares; infinite where the model runs away."""
        try:
            errors = self._errors_of(self.simulate(at, judged, slopes=False))
        except RanAway:
            return float("inf")
        column = (errors / judged.weights)[judged.flags, None]
        total = np.sum(_projected(column, judged.basis, judged.slow) ** 2)
        total += np.sum(self._strains(at)[0] ** 2)
        return 0.5 * float(total)

    def descend(self, at: Array, judged: Judged, evaluations: int) -> Array:
        """A local optimum near a point."""
        from scipy.optimize import least_squares

        kept: dict[bytes, tuple[Array, Array]] = {}

        def both(z: Array) -> tuple[Array, Array]:
            key = z.tobytes()
            if key not in kept:
                kept.clear()
                try:
                    kept[key] = _compressed(*self.residual(z * self.scale, judged))
                except RanAway:
                    count = len(z) + 1
                    kept[key] = (np.full(count, limits.RUNAWAY), np.zeros((count, len(z))))
            return kept[key]

        low, high = self._low / self.scale, self._high / self.scale
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

    def errors(self, at: Array, judged: Judged) -> tuple[dict[str, Array], Array]:
        """Simulated less measured readings less the part that sensor errors explain, per signal,
        NaN where nothing was measured; and those sensor errors."""
        whole, slow = self._errors_of(self.simulate(at, judged, slopes=False)), judged.slow
        if judged.drift.count:
            weights, flags = judged.weights, judged.flags
            moved = judged.drift.moved / weights[:, None]
            left = (whole / weights)[flags]
            normal = moved[flags].T @ moved[flags] + np.eye(len(slow))
            found = np.linalg.solve(normal, moved[flags].T @ left + slow)
            whole, slow = whole - judged.drift.moved @ found, slow - found
        signals = self.bench.signals
        return dict(zip(signals, np.split(whole, len(signals)), strict=True)), slow

    def _descended(self, at: Array, judged: Judged, evaluations: int) -> Array:
        """A local optimum, then one of the other values with the onsets held.

        Errors have a kink where an onset passes a sample, at which steps of all values end.
        """
        at = self.descend(at, judged, evaluations)
        times = [i for i, u in enumerate(self._unknowns, self._count) if u.driver == TIME]
        if not times:
            return at
        with self._held({i: float(at[i]) for i in times}):
            return self.descend(at, judged, evaluations)

    def finish(self, at: Array, judged: Judged, evaluations: int = 40, rounds: int = 2) -> Fitted:
        """Fit and estimate the noise in turn."""
        for _ in range(rounds):
            at = self._descended(at, judged, evaluations)
            errors, slow, judged = self.looked_at(at, judged)
        return self.as_fitted(at, errors, slow, judged)

    def looked_at(self, at: Array, judged: Judged) -> tuple[dict[str, Array], Array, Judged]:
        """The result of `errors` at a point, and the weights of samples by the noise there."""
        errors, slow = self.errors(at, judged)
        least = self.bench.record.resolution
        noise = {n: noise_of(e, judged.known[n], least[n]) for n, e in errors.items()}
        return errors, slow, replace(judged, noise=noise, slow=judged.drift.given(slow))

    def as_fitted(
        self, at: Array, errors: Mapping[str, Array], slow: Array, judged: Judged
    ) -> Fitted:
        """The model at a point, by the result of `looked_at` there."""
        negative_log_prior = 0.5 * float(np.sum(self._strains(at)[0] ** 2) + np.sum(slow**2))
        return Fitted(
            self.joined,
            self.values(at),
            self.free,
            judged.noise,
            errors,
            negative_log_prior,
            np.zeros((0, 0)),
            judged.slow,
            judged.drift.put_right(self.bench.record.inputs, judged.slow),
            judged.drift,
        )

    def with_covariance(self, fitted: Fitted, judged: Judged) -> Fitted:
        """Add the covariance of the parameters."""
        judged = replace(judged, noise=fitted.noise, slow=fitted.slow, drift=fitted.drift)
        at = self.vector(fitted.values)
        _, slopes = self.residual(at, judged)
        # A value that the data do not determine is uniform between its bounds.
        span = np.minimum(self._high - self._low, limits.SPREAD_OUT * self.scale) / self.scale
        scaled = np.linalg.inv(slopes.T @ slopes + np.diag(12.0 / span**2))
        step = self.scale * self.slopes(at)
        covariance = np.asarray(scaled * np.outer(step, step))
        return replace(fitted, covariance=covariance)


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


# Fits of plants that store to convergence, with sensor errors linearised again and the memory of
# errors taken into account.


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

    def gain(self, after: Fitted, before: Fitted, values: float | None = None) -> float:
        """Gain in log likelihood over another model, less the price of additional `values`: those
        that the recording determines, or else the number of unknowns.

        Source: Schwarz 1978.
        """
        found = sum(gain(before.noise[n], after.noise[n], self.samples[n]) for n in before.noise)
        found += before.negative_log_prior - after.negative_log_prior
        each = 0.5 * float(np.log(max(self.news(after), 2.0)))
        if values is None:
            more = [sum(not u.fixed for c in f.joined for u in c.unknowns) for f in (after, before)]
            values = more[0] - more[1]
        return found - each * values

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
    drift = drift_of(bench, first.values)
    ends = FinalFits(bench, Judged(bench.known, first.noise, drift, np.zeros(drift.count)))
    return ends, ends.polished(replace(first, slow=ends.judged.slow, drift=drift))


def fixed_values(fitted: Fitted) -> dict[str, float]:
    """Values of the fixed parameters of a model, SI by id."""
    fixed = {u.id for c in fitted.joined for u in c.unknowns if u.fixed}
    return {n: v for n, v in fitted.values.items() if n in fixed}
