"""Which trial explains most on blocks that it was not fitted to, and whether rivals lose.

Each model is fitted to the estimation blocks and judged on the selection blocks, and the other way
round. Differences are taken block by block: neighbouring points are alike, blocks less so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.robust import spread_about

from rulec.mismatch import limits
from rulec.mismatch.evidence.samples import ESTIMATION, SELECTION
from rulec.mismatch.evidence.steady.configuration import HIDDEN, Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.screen import (
    InitialCandidate,
    score_tests_at,
    with_open_references,
)
from rulec.mismatch.search.price import price_of_fit

Refit = tuple[Fitted, InitialCandidate]
"""A model refitted with a trial in it."""


@dataclass(frozen=True)
class CrossValidated:
    """A model with what it says of blocks it was not fitted to; `trial` is what it adds.

    `blocks` shape (blocks,): log likelihood per block of time, each by the fit without it.
    """

    trial: InitialCandidate | None
    fitted: Fitted
    blocks: Array

    def gain_over(self, other: CrossValidated) -> float:
        """Gain in log likelihood on blocks not fitted to, and of what is known without them."""
        return self.seen_over(other) + self.relief_over(other)

    def seen_over(self, other: CrossValidated) -> float:
        """Gain in log likelihood on blocks not fitted to."""
        return float(np.sum(self.blocks - other.blocks))

    def likelier_than(self, other: CrossValidated) -> float:
        """Gain in log likelihood on the blocks that both were fitted to.

        Which of two laws with as many values is there all data tell best together: a fit to half of
        them adds scatter of its own. Whether there is one at all, they cannot tell.
        """
        return float(np.sum((self.within - other.within)[self._judged]))

    def certainty_over(self, other: CrossValidated) -> float:
        """The same in standard deviations of its own scatter over blocks.

        Source: Vuong 1989, with blocks of time for independent samples.
        """
        difference = (self.within - other.within)[self._judged]
        spread = float(np.sqrt(len(difference) * np.var(difference, ddof=1) + 1.0))
        return float(np.sum(difference)) / spread if len(difference) > 1 else 0.0

    @cached_property
    def within(self) -> Array:
        """Log likelihood of every block, shape (blocks,), by the fit to all that may be seen."""
        fitted, data = self.fitted, self.fitted.rows.system.data
        seen = fitted.likelihood * fitted.used[fitted.rows.group_point]
        blocks = data.block[fitted.rows.group_point]
        found: Array = np.bincount(blocks, seen, minlength=len(self.blocks)).astype(float)
        return found

    def relief_over(self, other: CrossValidated) -> float:
        """How much less a model strains what was known before the recording."""
        return other.fitted.negative_log_prior - self.fitted.negative_log_prior

    @cached_property
    def _judged(self) -> np.ndarray:
        data = self.fitted.rows.system.data
        return np.unique(data.block[data.open])

    def sureness_over(self, other: CrossValidated) -> float:
        """The gain in standard deviations of what blocks scatter that have little part in it."""
        difference = (self.blocks - other.blocks)[self._judged]
        spread = spread_about(difference, float(np.median(difference)))
        gain = float(np.sum(difference)) + self.relief_over(other)
        return gain / float(np.sqrt(len(difference) * spread**2 + 1.0))


def contest(fitted: Fitted, trial: InitialCandidate | None) -> CrossValidated:
    """Judge a fit to all open points by refits to either half of the blocks.

    Degrees of faults in periods are taken from all of them: a period may lie in one block.
    """
    rows = fitted.rows
    data = rows.system.data
    degrees = {n: fitted.setting.values[n] for c in fitted.setting.courses for n in c.names()}
    # Half of the blocks may not hold what determines a value: there it stays about where it was.
    loosely = {
        n: (fitted.setting.values[n], limits.LOOSE * fitted.u(n))
        for n in fitted.setting.free_unknowns()
    }
    likelihood = np.zeros(rows.groups)
    part = data.part[rows.group_point]
    for fitted_to, judged in ((ESTIMATION, SELECTION), (SELECTION, ESTIMATION)):
        chosen = data.part == fitted_to
        half = fit(
            rows,
            fitted.setting,
            chosen,
            limits.HALF_STEPS,
            degrees,
            fitted.variance_inflation,
            loosely,
        )
        likelihood[part == judged] = half.likelihood[part == judged]
    blocks: Array = np.bincount(
        data.block[rows.group_point], likelihood, minlength=int(data.block.max()) + 1
    ).astype(float)
    return CrossValidated(trial, fitted, blocks)


def entered(fitted: Fitted, trial: InitialCandidate) -> CrossValidated:
    """Refit everything with a trial in it, and judge it."""
    return contest(*refit(fitted, trial))


def refit(fitted: Fitted, trial: InitialCandidate) -> Refit:
    """Refit everything with a trial in it.

    A calibration under a law that left something out says little of the repaired one, so it is let
    go; unless the values that it states do as well, which is the simpler explanation, or do for
    other conditions than the usual ones of this recording.
    """
    candidate, setting = trial.candidate, fitted.setting
    held = _joined(fitted, trial, setting), trial
    if candidate.sort not in ("physics", "ageing", HIDDEN):
        return held
    wider = setting.wider(candidate.modules, fitted.rows.system.contradicted)
    if not wider:
        return held
    freed = [_joined(fitted, trial, s) for s in wider]
    ways = [held, *((way, trial) for way in freed if way.keeps_trust)]
    elsewhere = with_open_references(fitted.rows.system, trial)
    if elsewhere is not None:
        ways.append((_joined(fitted, elsewhere, setting), elsewhere))
    return min(ways, key=lambda way: cost_of(way[0]))


def _joined(fitted: Fitted, trial: InitialCandidate, onto: Configuration) -> Fitted:
    setting = onto.joining(trial.candidate, trial.values, trial.fixed, trial.course)
    return fit(fitted.rows, setting, fitted.used, variance_inflation=fitted.variance_inflation)


def cost_of(fitted: Fitted) -> float:
    """What a fit leaves unexplained, and the price of what it asks for, in log likelihood."""
    return fitted.objective + fitted.contradiction + price_of_fit(fitted)


@dataclass(frozen=True)
class Shuffled:
    """Gains of a term as it was found, of its mean, and with its course shuffled by blocks."""

    own: float
    mean: float
    gains: Array

    @property
    def is_imitated(self) -> bool:
        """Does a shuffled course do as well? One that hardly changes has nothing to shuffle."""
        return self.own <= float(self.gains.max()) and not self.is_steady

    @property
    def is_steady(self) -> bool:
        """Does its mean explain as much?"""
        return limits.STEADY * self.own < self.mean < self.own / limits.STEADY


def shuffled_gains(before: Fitted, after: Fitted, count: int, seed: int) -> Shuffled:
    """What is gained by the term that was found, and by the same term with another course.

    Gains are those of one amplitude in front of the term, linearised, under the better look.
    """
    rows = before.rows
    at = before.predicted
    term = rows.system.flows(after.setting, at=at).values
    term = term - rows.system.flows(_aligned(before, after), at=at).values
    order = np.random.default_rng(seed)
    data = rows.system.data
    changed = {i: v for i, v in enumerate(term) if np.any(np.nan_to_num(v))}
    looks = score_tests_at(before)
    wide = np.array([np.inf])

    def gain(of: dict[int, Array]) -> float:
        column = rows.column(before.maps, of)[:, None]
        return max(look.best(column, -wide, wide)[1] for look in looks) if np.any(column) else 0.0

    gains = []
    for _ in range(count):
        chosen = _shuffled(data.block, order)
        gains.append(gain({i: np.nan_to_num(v)[chosen] for i, v in changed.items()}))
    own = {i: np.nan_to_num(v) for i, v in changed.items()}
    means = {i: np.full(len(v), float(np.mean(v[before.used]))) for i, v in own.items()}
    return Shuffled(gain(own), gain(means), np.array(gains))


def _aligned(before: Fitted, after: Fitted) -> Configuration:
    """The setting before, at the base values of the fit after: their difference is the term."""
    own = before.setting
    kept = {n: after.setting.values.get(n, v) for n, v in own.values.items()}
    return replace(own, values=kept)


def amplifies_noise(before: Fitted, after: Fitted) -> bool:
    """Is the term that was found of the size of what it makes of the readings' noise?

    A threshold within the noise of its driver, with a steep law behind it, follows the noise.
    """
    system, data = before.rows.system, before.rows.system.data
    there, bare = system.flows(after.setting), system.flows(_aligned(before, after))
    term = np.nan_to_num(there.values - bare.values)
    noise, usual = np.zeros_like(term), np.zeros_like(term)
    for name in {*there.by_reading, *bare.by_reading}:
        for i in range(len(term)):
            own = there.by_reading.get(name, {}).get(i, np.zeros(1))
            plain = bare.by_reading.get(name, {}).get(i, np.zeros(1))
            with np.errstate(invalid="ignore", over="ignore"):
                noise[i] += np.nan_to_num(((own - plain) * data.noise[name]) ** 2, posinf=1e100)
                usual[i] += np.nan_to_num((plain * data.noise[name]) ** 2, posinf=1e100)
    # Where a law is steep anyway, such as near shut-off, readings say little, and count little.
    weight = 1.0 / np.maximum(usual, max(float(np.median(usual[usual > 0], axis=None)), 1e-300))
    used = before.used
    loud, quiet = (float(np.sum((weight * v)[:, used])) for v in (term**2, noise))
    return loud < limits.LOUD**2 * quiet


def _shuffled(block: np.ndarray, order: np.random.Generator) -> np.ndarray:
    """Points in an order in which the blocks are shuffled."""
    numbers = order.permutation(np.unique(block))
    return np.concatenate([np.flatnonzero(block == b) for b in numbers])


def placebo_gains(
    fitted: Fitted, trial: InitialCandidate, columns: Sequence[Array], seed: int
) -> Array:
    """Gains of as many smooth functions of time as the trial has parameters, at the same place.

    `columns` are slopes of the residuals by an error at the place, each shape (rows,).
    """
    rows = fitted.rows
    data = rows.system.data
    order = np.random.default_rng(seed)
    count = sum(not u.fixed for u in trial.candidate.unknowns)
    phase = (data.time - data.time[0]) / max(float(np.ptp(data.time)), 1e-300)
    looks = score_tests_at(fitted)
    gains = []
    for column in columns:
        for _ in range(10):
            waves = [
                column
                * np.cos(2 * np.pi * (order.uniform(0.5, 6.0) * phase + order.uniform()))[
                    rows.point
                ]
                for _ in range(count)
            ]
            wide = np.full(count, np.inf)
            table = np.stack(waves, axis=1)
            gains.append(max(look.best(table, -wide, wide)[1] for look in looks))
    return np.array(gains)
