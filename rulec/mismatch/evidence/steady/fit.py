"""Refit all values of a model: base parameters within their priors, sensor errors, unknowns.

Residuals follow a Student distribution with a common scale: points that the model cannot explain
yet must not bend it, and the scale is that of what is left, not that of the noise alone.

Source: Lange, Little, Taylor 1989 (robust fits by the t distribution); Madsen, Nielsen, Tingleff
2004 (Gauss-Newton steps with damping by how well the last was foreseen).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.knowledge.belief import Belief, Coordinates, LocalBelief, peak_of
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.steady.configuration import (
    ERROR,
    Configuration,
    reading_and_recording,
)
from rulec.mismatch.evidence.steady.rows import Maps, Rows
from rulec.mismatch.evidence.steady.system import System


@dataclass(frozen=True, kw_only=True)
class Prior:
    """What is known of the free values before the recording; arrays have shape (values,).

    Values are fitted in `coordinates`, the logarithms of positive parameters. The first of them are
    parameters of the plant, of which `belief` tells; the others have a `mean` and a precision
    (`known`, 1/u^2; 0: nothing is known), and are Student distributed where `freedom` is finite.
    `lowest`, `highest` bound them; `size` is the scale on which a value moves. `odds` make up for
    what bounds cut off.
    """

    names: tuple[str, ...]
    coordinates: Coordinates
    belief: Belief
    mean: Array
    known: Array
    freedom: Array
    lowest: Array
    highest: Array
    size: Array
    odds: float = 0.0

    def of(self, values: Mapping[str, float]) -> Array:
        """Coordinates of values by their names, SI; where there is none, that of the mean."""
        means = self.coordinates.values(self.mean)
        own = np.array([values.get(n, m) for n, m in zip(self.names, means, strict=True)])
        return self.coordinates.of(own)

    def values(self, at: Array) -> dict[str, float]:
        """Values at coordinates, SI."""
        return dict(zip(self.names, self.coordinates.values(at).tolist(), strict=True))

    def near(self, at: Array) -> LocalBelief:
        """What is known near some coordinates."""
        k = len(self.belief.names)
        plant = self.belief.near(at[:k])
        mean, precision = self.mean.copy(), np.diag(self.known + 1e-12 / self.size**2)
        mean[:k] = plant.mean
        precision[:k, :k] += plant.precision
        stated = np.flatnonzero(self.known)
        known, freedom = self.known[stated], self.freedom[stated]
        square = known * (at - mean)[stated] ** 2
        wide = np.isfinite(freedom)
        tails = np.where(wide, peak_of(np.where(wide, freedom, 1.0)), 0.0) - 0.5 * square
        free = freedom[wide]
        tails[wide] += 0.5 * square[wide] - 0.5 * (free + 1.0) * np.log1p(square[wide] / free)
        at_wide = stated[wide]
        precision[at_wide, at_wide] *= (free + 1.0) / (free + square[wide])
        density = plant.density + self.odds + float(np.sum(tails + 0.5 * np.log(known)))
        return LocalBelief(density, mean, precision)


def prior_of(system: System, setting: Configuration) -> Prior:
    """What is known of the free values before the recording."""
    belief = system.belief
    errors = list(system.errors)
    unknowns = setting.free_unknowns()
    k = len(belief.names)
    size = k + len(errors) + len(unknowns)
    mean, known, scale = np.zeros(size), np.zeros(size), np.ones(size)
    freedom = np.full(size, np.inf)
    lowest, highest = np.full(size, -np.inf), np.full(size, np.inf)
    if k:
        mean[:k] = belief.mean
        scale[:k] = 1.0 / np.sqrt(np.diag(belief.near(belief.mean).precision))
        lowest[:k], highest[:k] = mean[:k] - limits.FARTHEST, mean[:k] + limits.FARTHEST
        lowest[:k] = np.where(belief.coordinates.positive, lowest[:k], -np.inf)
        highest[:k] = np.where(belief.coordinates.positive, highest[:k], np.inf)
    adrift = _adrift(setting)
    several = bool(system.data.sources)
    for i, name in enumerate(errors, start=k):
        own = reading_and_recording(name)[1] is not None
        share = common.OWN_ERROR if own else 1.0 - common.OWN_ERROR if several else 1.0
        known[i] = limits.DRIFTED**-2 if name in adrift else 1.0 / share
    bounds = setting.limits()
    for i, name in enumerate(unknowns, start=k + len(errors)):
        lowest[i], highest[i] = bounds[name]
        width = highest[i] - lowest[i]
        scale[i] = max(abs(setting.values[name]), 1e-3 * width if np.isfinite(width) else 1e-12)
        if name in setting.known:
            mean[i], width, freedom[i] = setting.known[name]
            known[i] = width**-2
    rest = np.zeros(size - k, dtype=bool)
    return Prior(
        names=(*belief.names, *errors, *unknowns),
        coordinates=Coordinates(np.concatenate([belief.coordinates.positive, rest])),
        belief=belief,
        mean=mean,
        known=known,
        freedom=freedom,
        lowest=lowest,
        highest=highest,
        size=scale,
    )


def _adrift(setting: Configuration) -> set[str]:
    """Errors of sensors that drift: when or at which temperature they were right is not known."""
    return {
        f"{ERROR}{c.module}.{c.place}" for c in setting.joined if c.sort == "sensor" and c.drivers
    }


@dataclass(frozen=True)
class Fitted:
    """A setting refitted to some points.

    `scale` is that of the residuals in units of their noise; `variance_inflation` how many
    neighbouring groups of rows say as much as one alone would (they are alike where something is
    left out). `used` flags points, shape (n,); `residual`, shape (rows,), is in units of its noise.
    `predicted` are the readings as reconciled by the model, shape (n,), SI. `likelihood` shape
    (groups,): log likelihood of every group of rows, also of those that were not used. Slopes
    are worked out when they are asked for: a step that is not taken, and a fit that is only
    judged, need none.
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
        """How changes of estimates show in the rows."""
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
    def known(self) -> LocalBelief:
        """What was known before, as it counts here."""
        return self.prior.near(self.at)

    @cached_property
    def normal(self) -> Array:
        """The normal matrix of the coordinates with their prior, shape (values, values)."""
        weights = self.weights
        half = self.jacobian * np.sqrt(weights)[:, None]
        normal: Array = half.T @ half + self.known.precision
        return normal

    @cached_property
    def weights(self) -> Array:
        """Weights of the rows in the normal matrix, shape (rows,)."""
        use = self.used[self.rows.point]
        robust = student_weights(self.rows, self.residual, self.scale)
        weights: Array = robust * use / (self.scale**2 * self.variance_inflation)
        return weights

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the values, SI, shape (values, values)."""
        size = np.sqrt(np.diag(self.normal))
        inverse = np.linalg.pinv(self.normal / np.outer(size, size), hermitian=True)
        size /= self.prior.coordinates.slopes(self.at)
        covariance: Array = inverse / np.outer(size, size)
        return covariance

    @property
    def negative_log_prior(self) -> float:
        """How much what was known before is strained, in log likelihood, less than by its best.

        The class of a sensor is a promise, which one that is known to err has broken: how far it is
        off at the usual temperature, say, is open.
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
    held : values that must stay where they are put.
    variance_inflation : divides the log likelihood against the priors.
    """
    system = rows.system
    prior = prior_of(system, setting)
    held = held or {}
    free = np.array([name not in held for name in prior.names], dtype=bool)
    at = prior.of({**setting.values, **held})
    use = used[rows.point]
    current = _evaluated(rows, setting, prior, at, used, variance_inflation, None)
    damping, harder = 1e-3, 2.0
    for _ in range(steps):
        step = _step(current, prior, at, free, damping)
        trial_at = np.clip(at + step, prior.lowest, prior.highest)
        trial = _evaluated(rows, setting, prior, trial_at, used, variance_inflation, current.scale)
        gain = current.objective - trial.objective
        if not np.isfinite(trial.objective) or gain < 0:
            damping, harder = damping * harder, 2.0 * harder
            if damping > limits.HARDEST:
                break
            continue
        # A valley that bends wants short steps: damping falls only as far as the last was foreseen.
        foreseen = gain / max(_promised(current, at, trial_at - at), 1e-300)
        easier = max(1.0 - (2.0 * min(foreseen, 1.0) - 1.0) ** 3, 1.0 / limits.EASIER)
        damping, harder = max(damping * easier, limits.SOFTEST), 2.0
        at, current = trial_at, trial
        if gain < limits.CONVERGED * max(int(use.sum()), 1) * 0.01:
            break
    return current


def _promised(now: Fitted, at: Array, step: Array) -> float:
    """By how much the objective would fall if slopes stayed as they are."""
    slope = _gradient(now, at)
    return -float(slope @ step + 0.5 * step @ now.normal @ step)


def _gradient(now: Fitted, at: Array) -> Array:
    slope: Array = now.jacobian.T @ (now.weights * now.residual)
    return slope + now.known.precision @ (at - now.known.mean)


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


def _evaluated(
    rows: Rows,
    setting: Configuration,
    prior: Prior,
    at: Array,
    used: np.ndarray,
    variance_inflation: float,
    scale: float | None,
) -> Fitted:
    """Residuals, scale and objective at some coordinates."""
    placed = replace(setting, values={**setting.values, **prior.values(at)})
    errors, predicted = rows.errors(rows.system.flows(placed))
    residual = _sound(errors)
    use = used[rows.point]
    scale = _scale(rows, residual, use, scale)
    likelihood = _likelihood(rows, residual, scale)
    said = float(likelihood[used[rows.group_point]].sum()) / variance_inflation
    objective = -prior.near(at).density - said
    if not np.isfinite(errors[use]).any():
        objective = np.inf  # where a law has no value anywhere, nothing is wrong any more
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


def evaluated(
    rows: Rows, setting: Configuration, prior: Prior, at: Array, used: np.ndarray
) -> Fitted:
    """A setting at some values, not fitted; `used` has shape (n,)."""
    return _evaluated(rows, setting, prior, at, used, 1.0, None)


def variance_inflation_of(fitted: Fitted) -> float:
    """How many neighbouring groups of rows are as good as one, by means over batches of time.

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
        means = (
            table[: count * limits.BATCHES].reshape(limits.BATCHES, count, cell.rank).mean(axis=1)
        )
        spread = np.var(table, axis=0)
        ratio = count * np.var(means, axis=0, ddof=1) / np.maximum(spread, 1e-300)
        factors.append((len(table), float(np.max(ratio))))
    if not factors:
        return 1.0
    counts, sizes = np.array(factors).T
    return float(np.clip(np.average(sizes, weights=counts), 1.0, rows.groups / limits.BATCHES))


def _sound(residual: Array) -> Array:
    """Where a law has no value (a root of something negative) it is as wrong as can be."""
    bad = ~np.isfinite(residual)
    if not bad.any():
        return residual
    # Less would pay: a law without a value where something is wrong would explain all of it.
    worst = max(10.0 * float(np.max(np.abs(residual[~bad]), initial=1.0)), limits.NO_VALUE)
    return np.where(bad, worst, residual)


def _distance(rows: Rows, residual: Array) -> Array:
    return rows.per_group(residual**2)


def student_weights(rows: Rows, residual: Array, scale: float) -> Array:
    """Weight of every row by the Student distribution, shape (rows,)."""
    rank = rows.group_rank
    weight = (limits.FREEDOM + rank) / (limits.FREEDOM + _distance(rows, residual) / scale**2)
    spread: Array = weight[rows.group]
    return spread


def _likelihood(rows: Rows, residual: Array, scale: float) -> Array:
    rank = rows.group_rank
    distance = _distance(rows, residual) / (limits.FREEDOM * scale**2)
    value: Array = -rank * np.log(scale) - 0.5 * (limits.FREEDOM + rank) * np.log1p(distance)
    return value


def _scale(rows: Rows, residual: Array, use: np.ndarray, start: float | None) -> float:
    """Most likely scale of the used residuals, by a few fixed-point steps."""
    distance, rank = _distance(rows, residual), rows.group_rank
    chosen = rows.per_group(use.astype(float)) > 0
    distance, rank = distance[chosen], rank[chosen]
    if not len(distance):
        return 1.0
    square = start**2 if start else max(float(np.median(distance / rank)), 1e-12)
    for _ in range(8 if start else 30):
        weight = (limits.FREEDOM + rank) / (limits.FREEDOM + distance / square)
        square = max(float(np.sum(weight * distance) / np.sum(rank)), 1e-12)
    return float(np.sqrt(square))
