"""Refit all values of a model: base parameters within their priors, sensor errors, unknowns.

Residuals follow a Student distribution with a common scale: points that the model cannot explain
yet must not distort it, and the scale includes errors of the model, not only noise.

Source: Lange, Little, Taylor 1989 (robust fits by the t distribution); Madsen, Nielsen, Tingleff
2004 (Gauss-Newton steps with damping by how well the last was predicted).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.knowledge.parameter_belief import LocalBelief
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import ERROR, Configuration, reading_and_recording
from rulec.mismatch.evidence.prior import Prior, prior_with
from rulec.mismatch.evidence.steady.rows import Maps, Rows
from rulec.mismatch.evidence.steady.system import System


def prior_of(system: System, setting: Configuration) -> Prior:
    """The prior of the free values of a model of settled points."""
    # When or at which temperature a sensor that drifts was right is not known.
    drifting = (c for c in setting.joined if c.sort == "sensor" and c.drivers)
    adrift = {f"{ERROR}{c.module}.{c.place}" for c in drifting}
    several = bool(system.data.sources)
    errors = {}
    for name in system.errors:
        own = reading_and_recording(name)[1] is not None
        share = common.OWN_ERROR if own else 1.0 - common.OWN_ERROR if several else 1.0
        errors[name] = limits.DRIFTED**-2 if name in adrift else 1.0 / share
    return prior_with(system.belief, errors, setting.limits(), setting)


@dataclass(frozen=True)
class Fitted:
    """A setting refitted to some points.

    `scale` is that of the residuals in units of their noise; `variance_inflation` is the number of
    neighbouring groups of rows with the information of one (they are correlated where an effect is
    missing). `used` flags points, shape (n,); `residual`, shape (rows,), is in units of its noise.
    `predicted` are the readings reconciled with the model, shape (n,), SI. `likelihood`, shape
    (groups,), is the log likelihood of every group of rows, used or not. Slopes are calculated on
    demand: rejected steps and models that are only compared need none.
    """

    setting: Configuration
    rows: Rows
    prior: Prior
    used: np.ndarray
    variance_inflation: float
    scale: float
    residual: Array
    predicted: Mapping[str, Array]
    likelihood: Array
    objective: float

    @property
    def maps(self) -> Maps:
        """Maps from changes of estimates to rows."""
        return self._slopes[0]

    @property
    def jacobian(self) -> Array:
        """Slopes of the residuals by the coordinates of the values, shape (rows, values)."""
        return self._slopes[1]

    @cached_property
    def _slopes(self) -> tuple[Maps, Array]:
        rows, setting = self.rows, self.setting
        stems = list(dict.fromkeys(name.partition("#")[0] for name in self.prior.names))
        flows = rows.system.flows(setting, stems, at=self.predicted)
        maps = rows.maps(flows)
        columns = {name: rows.column(maps, flows.by_value[name]) for name in stems}
        courses = {course.unknown: course for course in setting.courses}
        table = np.empty((len(self.prior.names), len(rows)))
        for row, name in zip(table, self.prior.names, strict=True):
            stem, _, number = name.partition("#")
            row[:] = columns[stem]
            if number:
                row *= courses[stem].share(int(number))[rows.point]
        return maps, table.T * self.prior.coordinates.slopes(self.at)

    @cached_property
    def at(self) -> Array:
        """The coordinates of the values, shape (values,)."""
        return self.prior.of(self.setting.values)

    @cached_property
    def local_prior(self) -> LocalBelief:
        """The prior near the coordinates."""
        return self.prior.near(self.at)

    @cached_property
    def normal(self) -> Array:
        """The normal matrix of the coordinates with their prior, shape (values, values)."""
        half = self.jacobian * np.sqrt(self.weights)[:, None]
        return np.asarray(half.T @ half + self.local_prior.precision)

    @cached_property
    def weights(self) -> Array:
        """Weights of the rows in the normal matrix, shape (rows,)."""
        use = self.used[self.rows.point]
        robust = student_weights(self.rows, self.residual, self.scale)
        return np.asarray(robust * use / (self.scale**2 * self.variance_inflation))

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the values, SI, shape (values, values)."""
        size = np.sqrt(np.diag(self.normal))
        inverse = np.linalg.pinv(self.normal / np.outer(size, size), hermitian=True)
        size /= self.prior.coordinates.slopes(self.at)
        return np.asarray(inverse / np.outer(size, size))

    @property
    def negative_log_prior(self) -> float:
        """Fall of the log prior density from its maximum.

        The class of a sensor that is known to err does not count: it says nothing about the size of
        that error.
        """
        prior, at = self.prior, self.at.copy()
        broken = {f"{ERROR}{c.module}.{c.place}" for c in self.setting.joined if c.sort == "sensor"}
        excused = [i for i, name in enumerate(prior.names) if name in broken]
        at[excused] = prior.mean[excused]
        return prior.near(prior.mean).density - prior.near(at).density

    def u(self, name: str) -> float:
        """Standard uncertainty of a value."""
        i = self.prior.names.index(name)
        return float(np.sqrt(max(self.covariance[i, i], 0.0)))


def fit(
    rows: Rows,
    setting: Configuration,
    used: np.ndarray,
    steps: int = limits.FIT_STEPS,
    held: Mapping[str, float] | None = None,
    variance_inflation: float = 1.0,
) -> Fitted:
    """Find the most probable values given some points.

    Parameters
    ----------
    setting : where to start.
    used : shape (n,), points to fit to.
    held : values that stay fixed.
    variance_inflation : divides the log likelihood against the priors.
    """
    prior = prior_of(rows.system, setting)
    held = held or {}
    free = np.array([name not in held for name in prior.names], dtype=bool)
    at = prior.of({**setting.values, **held})
    use = used[rows.point]
    current = evaluated(rows, setting, prior, at, used, variance_inflation)
    damping, harder = 1e-3, 2.0
    for _ in range(steps):
        step = _step(current, prior, at, free, damping)
        trial_at = np.clip(at + step, prior.lowest, prior.highest)
        trial = evaluated(rows, setting, prior, trial_at, used, variance_inflation, current.scale)
        gain = current.objective - trial.objective
        if not np.isfinite(trial.objective) or gain < 0:
            damping, harder = damping * harder, 2.0 * harder
            if damping > limits.HARDEST:
                break
            continue
        # A curved valley needs short steps: damping falls only after a step predicted well.
        change = trial_at - at
        slope = _gradient(current, at)
        predicted = -float(slope @ change + 0.5 * change @ current.normal @ change)
        quality = gain / max(predicted, 1e-300)
        easier = max(1.0 - (2.0 * min(quality, 1.0) - 1.0) ** 3, 1.0 / limits.EASIER)
        damping, harder = max(damping * easier, limits.SOFTEST), 2.0
        at, current = trial_at, trial
        if gain < limits.CONVERGED * max(int(use.sum()), 1) * 0.01:
            break
    return current


def _gradient(now: Fitted, at: Array) -> Array:
    slope: Array = now.jacobian.T @ (now.weights * now.residual)
    return slope + now.local_prior.precision @ (at - now.local_prior.mean)


def _step(now: Fitted, prior: Prior, at: Array, free: np.ndarray, damping: float) -> Array:
    gradient = _gradient(now, at)
    # A value at its bound does not move further out.
    stopped = ((at <= prior.lowest) & (gradient > 0)) | ((at >= prior.highest) & (gradient < 0))
    moving = np.flatnonzero(free & ~stopped)
    step = np.zeros(len(at))
    if len(moving):
        normal = now.normal[np.ix_(moving, moving)]
        size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        scaled = normal / np.outer(size, size) + damping * np.eye(len(moving))
        step[moving] = -np.linalg.solve(scaled, gradient[moving] / size) / size
    return step


def evaluated(
    rows: Rows,
    setting: Configuration,
    prior: Prior,
    at: Array,
    used: np.ndarray,
    variance_inflation: float = 1.0,
    scale: float | None = None,
) -> Fitted:
    """A setting at some coordinates, not fitted; `used` has shape (n,).

    The search for the scale of the residuals starts at `scale`, if given.
    """
    placed = replace(setting, values={**setting.values, **prior.values(at)})
    errors, predicted = rows.errors(rows.system.flows(placed))
    residual = _sound(errors)
    use = used[rows.point]
    scale = _scale(rows, residual, use, scale)
    rank = rows.group_rank
    distance = rows.per_group(residual**2) / (limits.FREEDOM * scale**2)
    likelihood = -rank * np.log(scale) - 0.5 * (limits.FREEDOM + rank) * np.log1p(distance)
    of_rows = float(likelihood[used[rows.group_point]].sum()) / variance_inflation
    objective = -prior.near(at).density - of_rows
    if not np.isfinite(errors[use]).any():
        objective = np.inf  # a law without any value would explain everything
    return Fitted(
        placed,
        rows,
        prior,
        used,
        variance_inflation,
        scale,
        residual,
        predicted,
        likelihood,
        objective,
    )


def variance_inflation_of(fitted: Fitted) -> float:
    """Number of neighbouring groups of rows with the information of one, by means over batches.

    Source: batch means (Geyer 1992).
    """
    rows = fitted.rows
    factors = []
    for cell in rows.cells:
        table = cell.table(fitted.residual).T / fitted.scale
        table = np.clip(table[fitted.used[cell.points]], -limits.ODD_RESIDUAL, limits.ODD_RESIDUAL)
        count = len(table) // limits.BATCHES
        if count < 2:
            continue
        batches = table[: count * limits.BATCHES].reshape(limits.BATCHES, count, cell.rank)
        means = batches.mean(axis=1)
        spread = np.var(table, axis=0)
        ratio = count * np.var(means, axis=0, ddof=1) / np.maximum(spread, 1e-300)
        factors.append((len(table), float(np.max(ratio))))
    if not factors:
        return 1.0
    counts, sizes = np.array(factors).T
    return float(np.clip(np.average(sizes, weights=counts), 1.0, rows.groups / limits.BATCHES))


def _sound(residual: Array) -> Array:
    """Residuals with a very large error where a law has no value (a root of a negative number)."""
    bad = ~np.isfinite(residual)
    if not bad.any():
        return residual
    # With a smaller error it would pay to have no value where the model is wrong.
    worst = max(10.0 * float(np.max(np.abs(residual[~bad]), initial=1.0)), limits.NO_VALUE)
    return np.where(bad, worst, residual)


def student_weights(rows: Rows, residual: Array, scale: float) -> Array:
    """Weight of every row by the Student distribution, shape (rows,)."""
    distance = rows.per_group(residual**2) / scale**2
    weight = (limits.FREEDOM + rows.group_rank) / (limits.FREEDOM + distance)
    return np.asarray(weight[rows.group])


def _scale(rows: Rows, residual: Array, use: np.ndarray, start: float | None) -> float:
    """Most likely scale of the used residuals, by fixed-point steps."""
    distance, rank = rows.per_group(residual**2), rows.group_rank
    chosen = rows.per_group(use.astype(float)) > 0
    distance, rank = distance[chosen], rank[chosen]
    if not len(distance):
        return 1.0
    square = start**2 if start else max(float(np.median(distance / rank)), 1e-12)
    for _ in range(8 if start else 30):
        weight = (limits.FREEDOM + rank) / (limits.FREEDOM + distance / square)
        square = max(float(np.sum(weight * distance) / np.sum(rank)), 1e-12)
    return float(np.sqrt(square))
