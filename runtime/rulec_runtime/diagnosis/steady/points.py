"""Operating points: readings of a stretch or of a sample, and their uncertainties."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.recordings.columns import (
    coarse_step,
    means_between,
    median_of,
    scale_interval,
)
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.slow_motion import lag_errors
from rulec_runtime.recordings.stationary import Stretches, systematic_u

EVERY = slice(None)

NO_READING = "no reading"
"""Why a reading is missing that nobody removed."""


@dataclass(frozen=True)
class Points:
    """Operating points to judge: one per stretch or one per sample.

    `values` per signal, shape (n,), SI; `u` the standard uncertainty of each, statistical and
    systematic together, `systematic` the part that does not average out; `bad` per signal (n,)
    flags with a reason in `why`; `time` shape (n,), s, if the points follow each other. `lag` is
    the error of moving readings if their lag is one standard uncertainty, signed, shape (n,), SI;
    not part of `u`. `stood_in` flags, per signal, shape (n,), values that replace a removed
    reading.
    """

    values: Mapping[str, Array]
    u: Mapping[str, Array]
    systematic: Mapping[str, Array]
    bad: Mapping[str, np.ndarray]
    why: Mapping[str, str]
    time: Array | None = None
    lag: Mapping[str, Array] = field(default_factory=dict)
    stood_in: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return max((len(v) for v in self.values.values()), default=0)

    def statistical(self, signal: str) -> Array:
        """Standard uncertainty that is new at each point, shape (n,), SI."""
        whole, shared = self.u[signal], self.systematic[signal]
        return np.asarray(np.sqrt(np.maximum(whole**2 - shared**2, 0.0)))

    def at(self, chosen: np.ndarray | slice) -> Points:
        """Some of the points."""
        own = self._each(lambda table: {name: column[chosen] for name, column in table.items()})
        return replace(own, time=None if self.time is None else self.time[chosen])

    def of(self, signals: Set[str]) -> Points:
        """The same with some of the signals only."""
        return self._each(lambda table: {n: column for n, column in table.items() if n in signals})

    def _each(self, change: Callable[[Mapping[str, Array]], Mapping[str, Array]]) -> Points:
        """Points with each table changed."""
        tables = "values", "u", "systematic", "bad", "lag", "stood_in"
        changed: dict[str, Any] = {name: change(getattr(self, name)) for name in tables}
        return replace(self, **changed)

    def put(
        self,
        signal: str,
        value: Array,
        u: Array | float,
        systematic: Array | float = 0.0,
        *,
        at: np.ndarray | slice = EVERY,
        stands_in: bool = False,
    ) -> Points:
        """The same with other values of a signal, SI, at some points, and their uncertainties."""
        tables = {"values": value, "u": u, "systematic": systematic, "bad": ~np.isfinite(value)}
        changed: dict[str, Any] = {}
        for name, new in (tables | {"stood_in": True} if stands_in else tables).items():
            columns = getattr(self, name)
            blank = np.zeros(len(self), dtype=bool if name in ("bad", "stood_in") else float)
            column = np.array(columns.get(signal, blank))
            column[at] = new
            changed[name] = {**columns, signal: column}
        return replace(self, **changed)

    @property
    def u_with_lag(self) -> dict[str, Array]:
        """Standard uncertainties including lags, shape (n,) each, SI."""
        lag = self.lag
        return {n: np.hypot(own, lag[n]) if n in lag else own for n, own in self.u.items()}


def one_after_the_other(several: Sequence[Points]) -> Points:
    """Points in a row; a signal that some of them lack has no reading there."""
    sizes = [len(points) for points in several]

    def row(table: str, blank: float) -> dict[str, Array]:
        tables = [getattr(points, table) for points in several]
        names = dict.fromkeys(name for one in tables for name in one)
        return {
            name: np.concatenate(
                [one.get(name, np.full(n, blank)) for one, n in zip(tables, sizes, strict=True)]
            )
            for name in names
        }

    times = [points.time for points in several if points.time is not None]
    return Points(
        values=row("values", np.nan),
        u=row("u", np.nan),
        systematic=row("systematic", np.nan),
        bad={name: column.astype(bool) for name, column in row("bad", 1.0).items()},
        why={name: text for points in several for name, text in points.why.items()},
        time=np.concatenate(times) if len(times) == len(several) else None,
        lag=row("lag", 0.0),
        stood_in={name: column.astype(bool) for name, column in row("stood_in", 0.0).items()},
    )


def outside_range(signal: SignalSpec, values: Array) -> np.ndarray:
    """Flags of readings, SI, that their sensor cannot show, shape (n,)."""
    low, high = signal.lowest, signal.highest
    if low is None or high is None:
        return np.zeros(len(values), dtype=bool)
    slack = common.BEYOND_RANGE * (high - low)
    with np.errstate(invalid="ignore"):
        outside: np.ndarray = (values < low - slack) | (values > high + slack)
    return outside


def _reasons(recording: Recording, ruleset: Ruleset) -> dict[str, str]:
    """Per signal why readings of it cannot be right, if some cannot."""
    why = {}
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None:
            continue
        reason = (recording.unfit or {}).get(signal.id, NO_READING)
        reasons = [] if np.isfinite(values).all() else [reason]
        if outside_range(signal, values).any():
            reasons.append("outside the sensor's range")
        why[signal.id] = " or ".join(dict.fromkeys(reasons))
    return why


def at_rest(ruleset: Ruleset, low: frozenset[str]) -> frozenset[str]:
    """Estimates with a signal below its minimum; for an input, all of its module."""
    modules = {n.partition(".")[0] for n in low if ruleset.signal_by_id[n].is_input}
    return frozenset(
        o.id
        for o in ruleset.observers
        if low and (o.module in modules or not low.isdisjoint(o.signals))
    )


def is_bad(signal: SignalSpec, values: Array) -> np.ndarray:
    """Flags of readings that cannot be right, shape (n,)."""
    return np.asarray(~np.isfinite(values) | outside_range(signal, values))


def _sound(signal: SignalSpec, values: Array) -> Array:
    return np.where(is_bad(signal, values), np.nan, values)


def points_of_stretches(
    recording: Recording, ruleset: Ruleset, stretches: Stretches, noise: Mapping[str, float]
) -> Points:
    """Mean readings of each stretch; the noise of a mean falls with the root of its length."""
    middle = 0.5 * (recording.time[stretches.first] + recording.time[stretches.last - 1])
    means = _means(recording, ruleset, stretches)
    points = _points(recording, ruleset, noise, means, middle)
    return replace(points, lag=lag_errors(recording, ruleset, stretches, noise))


def points_of_samples(recording: Recording, ruleset: Ruleset, noise: Mapping[str, float]) -> Points:
    """Every sample a point of its own."""
    columns = ((s, recording.values.get(s.id)) for s in ruleset.signals)
    readings = ((s, _sound(s, column), 1.0) for s, column in columns if column is not None)
    return _points(recording, ruleset, noise, readings, recording.time)


def _points(
    recording: Recording,
    ruleset: Ruleset,
    noise: Mapping[str, float],
    readings: Iterable[tuple[SignalSpec, Array, Array | float]],
    time: Array,
) -> Points:
    """Points of readings, NaN where there is none, each with the number of samples behind it."""
    values, u, systematic, bad = {}, {}, {}, {}
    for signal, column, number in readings:
        name, values[signal.id] = signal.id, column
        bad[name] = np.isnan(column)
        systematic[name] = systematic_u(signal, column) + np.zeros(len(column))
        with np.errstate(invalid="ignore", divide="ignore"):
            own = np.hypot(noise[name] / np.sqrt(number), rounding(signal, recording, noise[name]))
            u[name] = np.hypot(systematic[name], own)
    return Points(values, u, systematic, bad, _reasons(recording, ruleset), time)


def rounding(signal: SignalSpec, recording: Recording, noise: float) -> float:
    """Standard uncertainty by a display with coarse steps, SI; an input may be set in steps.

    Less noise than half a step is not averaged: all samples show the same level. Source: GUM
    F.2.2.1.
    """
    values = recording.values[signal.id]
    least = max(limits.DITHERED * noise, float(systematic_u(signal, median_of(np.abs(values)))))
    if signal.is_input:
        return 0.0
    few = abs(signal.factor) * scale_interval(signal.shown(values), limits.ROUNDED_LEVELS)
    step = few if few > least else coarse_step(values, least, limits.ROUNDED_LEVELS)
    return step / math.sqrt(12.0)


def means_of_stretches(
    recording: Recording, ruleset: Ruleset, stretches: Stretches
) -> dict[str, Array]:
    """Mean readings of each stretch alone, shape (n,), SI."""
    return {signal.id: mean for signal, mean, _ in _means(recording, ruleset, stretches)}


def _means(
    recording: Recording, ruleset: Ruleset, stretches: Stretches
) -> Iterator[tuple[SignalSpec, Array, Array]]:
    """Per signal the mean of its sound readings in each stretch, NaN if there are too few, and
    their number."""
    for signal in ruleset.signals:
        readings = recording.values.get(signal.id)
        if readings is not None:
            usable = partial(_sound, signal)
            mean, number = means_between(readings, stretches.first, stretches.last, usable)
            few = number < limits.HALF_PRESENT * (stretches.lengths - 1)
            yield signal, np.where(few, np.nan, mean), number
