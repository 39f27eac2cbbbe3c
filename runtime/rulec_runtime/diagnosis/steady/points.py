"""Operating points: readings of a stretch or of a sample, and by how much they may be off."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, field

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.slow_motion import lag_errors
from rulec_runtime.recordings.stationary import Stretches, systematic_u
from rulec_runtime.recordings.sums import means_between


@dataclass(frozen=True)
class Points:
    """Operating points to judge: one per stretch or one per sample.

    `values` per signal, shape (n,), SI; `u` the standard uncertainty of each, statistical and
    systematic together, `systematic` the part that does not average out; `bad` per signal (n,)
    flags with a reason in `why`; `time` shape (n,), s, where the points follow each other. `lag`
    is by how much readings that move are off if their lag is one standard uncertainty, signed,
    shape (n,), SI; no part of `u`.
    """

    values: Mapping[str, Array]
    u: Mapping[str, Array]
    systematic: Mapping[str, Array]
    bad: Mapping[str, np.ndarray]
    why: Mapping[str, str]
    time: Array | None = None
    lag: Mapping[str, Array] = field(default_factory=dict)

    def statistical(self, signal: str) -> Array:
        """Standard uncertainty that is new at each point, shape (n,), SI."""
        whole, shared = self.u[signal], self.systematic[signal]
        part: Array = np.sqrt(np.maximum(whole**2 - shared**2, 0.0))
        return part

    def at(self, chosen: np.ndarray) -> Points:
        """Some of the points."""
        values, u, systematic, bad, lag = (
            {name: part[chosen] for name, part in table.items()}
            for table in (self.values, self.u, self.systematic, self.bad, self.lag)
        )
        time = None if self.time is None else self.time[chosen]
        return Points(values, u, systematic, bad, self.why, time, lag)

    def of(self, signals: Set[str]) -> Points:
        """The same with some of the signals alone."""
        values, u, systematic, bad, lag = (
            {name: column for name, column in table.items() if name in signals}
            for table in (self.values, self.u, self.systematic, self.bad, self.lag)
        )
        return Points(values, u, systematic, bad, self.why, self.time, lag)

    def with_lag(self, u: Mapping[str, Array]) -> dict[str, Array]:
        """Standard uncertainties with that by lags, shape (n,) each, SI."""
        return {n: np.hypot(part, self.lag[n]) if n in self.lag else part for n, part in u.items()}


def outside_range(signal: SignalSpec, values: Array) -> np.ndarray:
    """Readings, SI, that its sensor cannot show, shape (n,)."""
    low, high = signal.lowest, signal.highest
    if low is None or high is None:
        return np.zeros(len(values), dtype=bool)
    slack = limits.BEYOND_RANGE * (high - low)
    with np.errstate(invalid="ignore"):
        outside: np.ndarray = (values < low - slack) | (values > high + slack)
    return outside


def check_readings(
    recording: Recording, ruleset: Ruleset
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Flag readings that cannot be right, and say why.

    Returns per signal flags, shape (n,), and the reason.
    """
    bad, why = {}, {}
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None:
            continue
        flags = ~np.isfinite(values)
        known = (recording.unfit or {}).get(signal.id, "no reading")
        reasons = [known] if flags.any() else []
        outside = outside_range(signal, values)
        if outside.any():
            reasons.append("outside the sensor's range")
        flags |= outside
        bad[signal.id] = flags
        why[signal.id] = " or ".join(dict.fromkeys(reasons))
    return bad, why


def points_of_stretches(
    recording: Recording, ruleset: Ruleset, stretches: Stretches, noise: Mapping[str, float]
) -> Points:
    """Mean readings of each stretch; the noise of a mean falls with the root of its length."""
    bad, why = check_readings(recording, ruleset)
    values, u, systematic, flags = {}, {}, {}, {}
    for name, mean, number in _means(recording, ruleset, stretches, bad):
        with np.errstate(invalid="ignore", divide="ignore"):
            statistical = noise[name] / np.sqrt(number)
        flags[name] = number < limits.HALF_KNOWN * stretches.lengths
        values[name] = np.where(flags[name], np.nan, mean)
        signal = ruleset.signal_by_id[name]
        systematic[name] = systematic_u(signal, values[name]) + np.zeros(len(mean))
        u[name] = np.hypot(systematic[name], statistical)
    middle = 0.5 * (recording.time[stretches.first] + recording.time[stretches.last - 1])
    lag = lag_errors(recording, ruleset, stretches, noise)
    return Points(values, u, systematic, flags, why, middle, lag)


def means_of_stretches(
    recording: Recording, ruleset: Ruleset, stretches: Stretches
) -> dict[str, Array]:
    """Mean readings of each stretch alone, shape (n,), SI."""
    bad, _ = check_readings(recording, ruleset)
    found = {}
    for name, mean, number in _means(recording, ruleset, stretches, bad):
        found[name] = np.where(number < limits.HALF_KNOWN * stretches.lengths, np.nan, mean)
    return found


def _means(
    recording: Recording, ruleset: Ruleset, stretches: Stretches, bad: Mapping[str, np.ndarray]
) -> Iterator[tuple[str, Array, Array]]:
    """Per signal the mean of its sound readings in each stretch, and how many these are."""
    for signal in ruleset.signals:
        readings = recording.values.get(signal.id)
        if readings is not None:
            usable = np.where(bad[signal.id], np.nan, readings)
            yield signal.id, *means_between(usable, stretches.first, stretches.last)


def points_of_samples(recording: Recording, ruleset: Ruleset, noise: Mapping[str, float]) -> Points:
    """Every sample a point of its own."""
    bad, why = check_readings(recording, ruleset)
    values, u, systematic = {}, {}, {}
    for signal in ruleset.signals:
        readings = recording.values.get(signal.id)
        if readings is None:
            continue
        values[signal.id] = np.where(bad[signal.id], np.nan, readings)
        systematic[signal.id] = systematic_u(signal, readings) + np.zeros(len(readings))
        u[signal.id] = np.hypot(systematic[signal.id], noise[signal.id])
    return Points(values, u, systematic, bad, why, recording.time)
