"""The baseline: what the fault-free part of a recording says of errors that last.

A systematic error of a sensor and an error of the calibration hardly change from one minute to
the next. Stretches in which nothing contradicts bound them, so a later stretch is judged against
these: what was off by the same amount before is no fault. Errors are unknowns with a standard
normal prior that drift slowly; each healthy stretch conditions them in turn.

Source: own derivation, docs/method.md; the recursion is a Kalman filter of an Ornstein-Uhlenbeck
process.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from runtime.observe import Observed
from runtime.plan import Array
from runtime.redundancy import chi_square_limit, residual_basis
from runtime.ruleset import Ruleset

CALM = 2.0
"""Normal quantile up to which a stretch counts as fault-free enough to learn from."""

WORTH = 0.02
"""Information (nat) below which a further stretch is not worth learning."""


LASTING = 6.0 * 3600.0
"""Time, s, over which lasting errors lose their memory: a quarter of the daily cycle of ambient
temperature, which moves most of them [assumed]."""


@dataclass(frozen=True)
class Baseline:
    """Mean, shape (errors,), and covariance of the lasting errors, in standard uncertainties.

    `learned` are the points it rests on, `time` is that of the last of them, s.
    """

    mean: Array
    covariance: Array
    learned: tuple[int, ...]
    time: float

    def later(self, time: float) -> Baseline:
        """What is still known at a later time: the rest of the errors is as before anything."""
        kept = float(remembered(time - self.time))
        drifted = (1.0 - kept**2) * np.eye(len(self.mean))
        covariance = kept**2 * self.covariance + drifted
        return replace(self, mean=kept * self.mean, covariance=covariance, time=time)


@dataclass(frozen=True)
class Baselines:
    """Baselines in order of time, and which of them holds at each point, shape (n,)."""

    states: tuple[Baseline, ...]
    at: np.ndarray


def nothing_learned(observed: Observed) -> Baseline:
    """What is known of the lasting errors without any fault-free stretch: their uncertainties."""
    count = observed.shared.shape[1]
    return Baseline(np.zeros(count), np.eye(count), (), 0.0)


def remembered(seconds: Array | float) -> Array:
    """Correlation of a lasting error with itself after some time."""
    correlation: Array = np.exp(-np.abs(seconds) / LASTING)
    return correlation


def learn(ruleset: Ruleset, observed: Observed) -> Baselines:
    """Go through the points in order of time and learn from those that nothing contradicts."""
    states = [nothing_learned(observed)]
    at = np.zeros(len(observed), dtype=int)
    time = times_of(observed)
    outside = np.any([*observed.extrapolated.values(), np.zeros(len(observed), bool)], axis=0)
    for point, residuals, shared, noise in _residuals(ruleset, observed):
        at[point] = len(states) - 1
        if not outside[point]:
            before = states[-1].later(time[point])
            updated = _update(before, point, residuals, shared, noise)
            if updated is not None:
                states.append(updated)
    return Baselines(tuple(states), _filled(at))


def _residuals(ruleset: Ruleset, observed: Observed) -> Iterator[tuple[int, Array, Array, Array]]:
    """Per judgeable point: residuals (rank,), their shared gradients, covariance of the noise."""
    known: dict[bytes, Array] = {}
    for point in range(len(observed)):
        valid = observed.valid[:, point]
        key = valid.tobytes()
        if key not in known:
            known[key] = residual_basis(ruleset, valid)
        basis = known[key]
        if len(basis):
            noise = basis @ observed.noise[point][np.ix_(valid, valid)] @ basis.T
            shared = basis @ observed.shared[valid, :, point]
            yield point, basis @ observed.flows[valid, point], shared, noise


def _update(
    before: Baseline, point: int, residuals: Array, shared: Array, noise: Array
) -> Baseline | None:
    """Condition on a point; None if it deviates, or adds next to nothing."""
    if not (np.isfinite(residuals).all() and np.isfinite(shared).all()):
        return None
    crossed = before.covariance @ shared.T
    total = noise + shared @ crossed
    off = residuals - shared @ before.mean
    solved = np.linalg.solve(total, np.column_stack([off, crossed.T]))
    if off @ solved[:, 0] > chi_square_limit(len(off), CALM):
        return None
    gain = np.linalg.slogdet(total)[1] - np.linalg.slogdet(noise)[1]
    if gain < WORTH * len(off):
        return None
    covariance = before.covariance - crossed @ solved[:, 1:]
    return Baseline(
        before.mean + crossed @ solved[:, 0],
        0.5 * (covariance + covariance.T),
        (*before.learned, point),
        before.time,
    )


def times_of(observed: Observed) -> Array:
    """Time of each point, s; all the same where the points do not follow each other."""
    time = observed.points.time
    return np.zeros(len(observed)) if time is None else time


def _filled(at: np.ndarray) -> np.ndarray:
    """Points that could not be judged take the baseline of the point before."""
    filled: np.ndarray = np.maximum.accumulate(at)
    return filled


def against(
    ruleset: Ruleset, observed: Observed, baselines: Baselines, at: np.ndarray | None = None
) -> Observed:
    """The same points seen against their baselines: flows shifted, covariances conditioned.

    `at` gives the baseline of each point where the points are not those that were learned from.
    """
    offsets = np.zeros_like(observed.flows)
    lasting = np.zeros_like(observed.noise)
    at = baselines.at if at is None else at
    time, unconditioned = times_of(observed), observed.covariance - observed.noise
    for index in np.unique(at):
        here, state = np.flatnonzero(at == index), baselines.states[index]
        kept = remembered(time[here] - state.time)
        shared = observed.shared[:, :, here]
        offsets[:, here] = kept * np.einsum("omn,m->on", shared, state.mean)
        spread = np.einsum("omn,mk->nok", shared, _factor(state.covariance), optimize=True)
        known = (kept**2)[:, None, None]
        lasting[here] = known * (spread @ np.swapaxes(spread, 1, 2))
        lasting[here] += (1.0 - known) * unconditioned[here]
    covariance = observed.noise + lasting
    return replace(
        observed,
        offsets=offsets,
        covariance=covariance,
        residuals=observed.residuals - _signed(ruleset, offsets),
        residual_u=_spreads(ruleset, covariance),
        residual_systematic=_spreads(ruleset, lasting),
    )


def _signed(ruleset: Ruleset, offsets: Array) -> Array:
    """Offsets of the residuals, shape (residuals, n)."""
    row = ruleset.observer_index
    sums = [sum(t.sign * offsets[row[t.observer]] for t in r.terms) for r in ruleset.residuals]
    return np.array(sums).reshape(-1, offsets.shape[1])


def _spreads(ruleset: Ruleset, covariance: Array) -> Array:
    """Standard uncertainties of the residuals, shape (residuals, n)."""
    row = ruleset.observer_index
    result = np.zeros((len(ruleset.residuals), len(covariance)))
    for i, residual in enumerate(ruleset.residuals):
        places = [row[t.observer] for t in residual.terms]
        signs = np.array([float(t.sign) for t in residual.terms])
        own = covariance[:, places][:, :, places]
        variance = np.einsum("i,nij,j->n", signs, own, signs, optimize=True)
        result[i] = np.sqrt(np.maximum(variance, 0.0))
    return result


def _factor(covariance: Array) -> Array:
    """A square root of a covariance, without directions that carry nothing."""
    sizes, axes = np.linalg.eigh(covariance)
    kept = sizes > 1e-12
    factor: Array = axes[:, kept] * np.sqrt(sizes[kept])
    return factor
