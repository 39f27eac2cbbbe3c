"""Noise and slow errors of sensors in the readings of a plant that stores."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust_statistics import Flags, autocorrelation_time, correlations_of
from rulec_runtime.recordings.stationary import systematic_u
from scipy.linalg import solve_discrete_are, toeplitz
from scipy.linalg.lapack import dtbtrs

from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem

# The noise of a simulation error: its size and its correlation time.
#
# A plain model is off for long stretches. If every sample counted as independent, every candidate
# that bends the course would seem certain. So squares of errors count once per correlation time.
#
# Source: effective number of samples for squares of an autocorrelated series (Bartlett 1946).


@dataclass(frozen=True)
class Noise:
    """Standard deviation of an error, SI, and the number of samples per independent one."""

    spread: float
    correlation_time: float

    @property
    def weight(self) -> float:
        """Divisor of an error that makes half its square a loss of log likelihood, nats."""
        return float(self.spread * np.sqrt(self.correlation_time))


def noise_of(error: Array, flags: Flags, least: float) -> Noise:
    """Estimate the noise of an error.

    Parameters
    ----------
    error : shape (n,); those with `flags` count.
    least : lower bound of the standard deviation, such as the resolution of the sensor.
    """
    own = error[flags]
    spread = float(np.sqrt(np.mean(own**2))) if len(own) else least
    return Noise(max(spread, least, limits.LEAST_ERROR), autocorrelation_time(error, flags))


def score_covariance(columns: Array, error: Array, flags: Flags) -> Array:
    """Covariance of the products of columns with an error correlated in time.

    Parameters
    ----------
    columns : shape (n, k), zero without `flags`.
    error : shape (n,); its autocorrelations count up to where they vanish.

    Returns shape (k, k), per variance of the error.

    Source: Newey and West 1987; a negative spectrum counts as zero.
    """
    size = 2 ** int(np.ceil(np.log2(2 * len(error))))
    lags = correlations_of(error, flags)[0]
    course = np.zeros(size)
    course[0] = 1.0
    course[1 : 1 + len(lags)] = lags
    course[size - len(lags) :] = lags[::-1]
    spectrum = np.maximum(np.fft.rfft(course).real, 0.0)
    waves = np.fft.rfft(columns, size, axis=0)
    double = np.full(len(spectrum), 2.0)
    double[[0, -1]] = 1.0
    weighted = waves.conj() * (spectrum * double)[:, None]
    found: Array = (weighted.T @ waves).real / size
    return 0.5 * (found + found.T)


def gain(before: Noise, after: Noise, samples: int) -> float:
    """Rise of the log likelihood, with the size of the noise unknown."""
    count = samples / max(after.correlation_time, 1.0)
    return float(count * np.log(before.spread / after.spread))


# Innovations of a reading with white noise and a correlated error.
#
# Source: Anderson and Moore 1979, chapter 4 (the Kalman filter that has settled); Hartikainen and
# Sarkka 2010 (Matern covariances as its models).


@dataclass(frozen=True)
class Innovations:
    """The part of each sample that earlier ones do not predict, over its standard deviation.

    The first ones follow from `first`, shape (m, m), all others from a filter with the coefficients
    `above` over `below` and the standard deviation `spread`.
    """

    first: Array
    above: Array
    below: Array
    spread: float

    def of(self, columns: Array, runs: Sequence[slice]) -> Array:
        """Innovations of rows of one signal, shape (n,) or (n, columns), for each run by itself."""
        if not columns.size:  # LAPACK would write out of bounds.
            return columns.copy()
        rows = np.zeros((len(columns), columns[0].size))
        wide = columns.reshape(rows.shape)
        with np.errstate(all="ignore"):
            for back, share in enumerate(self.above):
                rows[back:] += share * wide[: len(wide) - back]
            band = np.repeat(self.below[:, None], len(rows), axis=1)
            found: Array = dtbtrs(band, rows, uplo="L")[0].reshape(columns.shape) / self.spread
            for run in runs:
                m = min(len(self.first), run.stop - run.start)
                own = slice(run.start - runs[0].start, run.start - runs[0].start + m)
                found[own] = self.first[:m, :m] @ columns[own]
        return found

    def logs(self, runs: Sequence[slice]) -> float:
        """Sum of the logarithms of the standard deviations."""
        total = 0.0
        for rows in runs:
            m = min(len(self.first), rows.stop - rows.start)
            total += (rows.stop - rows.start - m) * float(np.log(self.spread)) - self._first_logs[m]
        return total

    @cached_property
    def _first_logs(self) -> list[float]:
        """Sums of the negative logarithms of the first 0, 1, ... standard deviations."""
        logs: list[float] = np.cumsum(np.log(np.diag(self.first))).tolist()
        return [0.0, *logs]


@lru_cache(maxsize=4096)
def innovations(size: float, lasts: float, smoothness: float) -> Innovations:
    """Innovations of white noise of unit variance with a correlated error.

    `size` is the standard deviation of the error, `lasts` its correlation time in samples. A
    `smoothness` of 1 is that of a random walk (Matern 1/2); with 3 the slope is correlated too
    (Matern 3/2), as where a store integrates errors of flows.
    """
    rate = float(np.sqrt(smoothness)) / lasts
    gap = np.arange(limits.FIRST_INNOVATIONS, dtype=float)
    if smoothness > 1.0:
        alike = size**2 * (1.0 + rate * gap) * np.exp(-rate * gap)
        step = np.exp(-rate) * np.array([[1.0 + rate, 1.0], [-(rate**2), 1.0 - rate]])
        covariance = np.diag([size**2, (rate * size) ** 2])
    else:
        alike = size**2 * np.exp(-rate * gap)
        step, covariance = np.array([[np.exp(-rate)]]), np.array([[size**2]])
    shown = np.eye(1, len(step))
    first = np.linalg.inv(np.linalg.cholesky(toeplitz(alike) + np.eye(len(gap))))
    innovation = covariance - step @ covariance @ step.T
    ahead = solve_discrete_are(step.T, shown.T, 0.5 * (innovation + innovation.T), np.ones((1, 1)))
    whole = float(ahead[0, 0]) + 1.0
    gain = step @ ahead[:, :1] / whole @ shown
    above, below = (np.asarray(np.poly(each), dtype=np.float64) for each in (step, step - gain))
    return Innovations(first, above, below, float(np.sqrt(whole)))


# Effects of sensor errors within their class, which no model has to explain.
#
# Each reading may be off by its stated uncertainty. An error of a flow meter fills a tank with no
# other outflow without limit; such an error may also change slowly. Its effect on predicted
# readings is removed from their errors as far as its size allows.


@dataclass(frozen=True)
class Drift:
    """Sensor errors within their class, each in units of its standard uncertainty.

    `shapes` has the input and the course, SI, shape (n,), of each error of an input. `moved` are
    the effects of these, and then of the zero errors of predicted readings, on readings, shape
    (signals * samples, errors), with the measured signals stacked.
    """

    moved: Array
    shapes: tuple[tuple[str, Array], ...]

    @property
    def count(self) -> int:
        """Number of errors."""
        return int(self.moved.shape[1])

    def put_right(self, inputs: Mapping[str, Array], errors: Array) -> dict[str, Array]:
        """Inputs, shape (n,), SI, corrected for errors, shape (errors,)."""
        result = dict(inputs)
        for (name, shape), size in zip(self.shapes, errors, strict=False):
            if size:
                result[name] = result[name] + size * shape
        return result

    def given(self, errors: Array) -> Array:
        """Errors of inputs, with all others 0, shape (errors,)."""
        return np.where(np.arange(self.count) < len(self.shapes), errors, 0.0)


def no_drift(problem: SimulationProblem) -> Drift:
    """No sensor errors."""
    return Drift(np.zeros((len(problem.signals) * len(problem.time), 0)), ())


def drift_of(problem: SimulationProblem, values: Mapping[str, float]) -> Drift:
    """All notable sensor errors, linearised at the plain model."""
    record, shapes = problem.record, list[tuple[str, Array]]()
    plain = problem.simulate((), values).stacked
    spread = np.repeat([np.nanstd(v) for v in record.measured.values()], len(problem.time))
    for name, u in _classes(problem, ()):
        changed = {**record.inputs, name: record.inputs[name] + u}
        moved = problem.simulate((), values, inputs=changed).stacked
        size = float(np.max(np.abs(moved - plain) / np.maximum(spread, 1e-300)))
        if size > limits.LARGE_DRIFT:
            shapes += [(name, u * shape) for shape in hats(problem.time, limits.DRIFT_KNOTS)]
        elif size >= limits.NOTABLE_DRIFT:
            shapes.append((name, u))
    return Drift(_moved(problem, shapes, (), values, record.inputs), tuple(shapes))


def moved_again(
    drift: Drift,
    problem: SimulationProblem,
    joined: tuple[str, ...],
    values: Mapping[str, float],
    inputs: Mapping[str, Array],
) -> Drift:
    """The same errors, linearised at another model, where other volumes may run over a rim.
    `inputs` have shape (n,), SI."""
    return replace(drift, moved=_moved(problem, drift.shapes, joined, values, inputs))


def errors_of_sensors(
    problem: SimulationProblem, ids: tuple[str, ...], values: Mapping[str, float]
) -> Array:
    """Effects of constant sensor errors within their class on readings, stacked, shape (signals *
    samples, errors), SI. Errors that move belong to the correlated error of a model."""
    return _moved(problem, list(_classes(problem, ids)), ids, values, problem.record.inputs)


def _classes(problem: SimulationProblem, ids: tuple[str, ...]) -> Iterator[tuple[str, Array]]:
    """Each input of a model, with the standard uncertainty by its class, shape (n,), SI."""
    for name, course in problem.record.inputs.items():
        if name in problem.balances(ids).inputs:
            u = systematic_u(problem.ruleset.signal_by_id[name], course)
            yield name, np.broadcast_to(u, course.shape)


def _moved(
    problem: SimulationProblem,
    shapes: Sequence[tuple[str, Array]],
    ids: tuple[str, ...],
    values: Mapping[str, float],
    inputs: Mapping[str, Array],
) -> Array:
    """Effects of errors of inputs, and of the zero error of each predicted reading, on readings,
    stacked, shape (signals * samples, errors), SI."""
    plain, columns = problem.simulate(ids, values, inputs=inputs).stacked, list[Array]()
    for name, error in shapes:
        changed = {**inputs, name: inputs[name] + error}
        columns.append(problem.simulate(ids, values, inputs=changed).stacked - plain)
    for i, (name, course) in enumerate(problem.record.measured.items()):
        own = np.zeros((len(problem.signals), len(course)))
        own[i] = np.nan_to_num(systematic_u(problem.ruleset.signal_by_id[name], course))
        columns.append(own.ravel())
    return np.column_stack(columns)


def hats(over: Array, knots: int) -> list[Array]:
    """Piecewise linear shapes, shape (n,), over the range of a course, which add up to one."""
    ends = np.linspace(over.min(), over.max(), knots)
    return [np.interp(over, ends, row) for row in np.eye(knots)]
