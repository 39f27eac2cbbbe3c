"""Find the stretches in which the plant stands still enough to be judged.

The relations of a ruleset hold for settled operation. A stretch ends where a reading jumps by more
than its noise and its sensor's uncertainty explain; slow drift is no end. The noise is estimated
from second differences, which neither steps nor slopes disturb (robustly: from their median).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import ObserverSpec, Ruleset, SignalSpec
from rulec_runtime.recordings.once import once
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.robust import medians, white_noise


@dataclass(frozen=True)
class Stretches:
    """Settled parts of a recording: samples ``first[i] : last[i]`` (last excluded)."""

    first: NDArray[np.intp]
    last: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.first)

    @property
    def lengths(self) -> NDArray[np.intp]:
        """Samples of each stretch."""
        return self.last - self.first


@dataclass(frozen=True)
class Timeline:
    """When stretches were, whether or not their samples are still there.

    Attributes
    ----------
    since, until : shape (n,), s, times of the first and the last sample of each.
    samples : shape (n,), how many each has.
    later : shape (n,), how many came after it.
    paused : shape (n,), whether nothing was recorded for long before it.
    """

    since: Array
    until: Array
    samples: NDArray[np.intp]
    later: NDArray[np.intp]
    paused: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.since)


def timeline_of(time: Array, stretches: Stretches) -> Timeline:
    """When the stretches of a recording were."""
    since, until = time[stretches.first], time[stretches.last - 1]
    paused = np.zeros(len(stretches), dtype=bool)
    paused[1:] = since[1:] - until[:-1] > long_pause(time)
    return Timeline(since, until, stretches.lengths, len(time) - stretches.last, paused)


def long_pause(time: Array) -> float:
    """From which time without samples on what was before is another matter, s."""
    interval = float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    return limits.LONGEST_STRETCH * interval


def noise_of(values: Array) -> float:
    """Standard deviation of white noise in a record, by second differences: steps and slopes hardly
    move it."""
    return _noise_of_second(np.diff(values[np.isfinite(values)], 2), 0.0)


def _noise_of_second(second: Array, unknown: float) -> float:
    """Noise by second differences, some of which may be no numbers; `unknown` where none is."""
    second = second[np.isfinite(second)]
    return white_noise(second, 2) if len(second) else unknown


def settle(recording: Recording, ruleset: Ruleset) -> tuple[Stretches, dict[str, float]]:
    """Settled stretches, and the noise of every reading within them, SI."""
    noise = noise_at_work(recording, ruleset)
    stretches = settled_stretches(recording, ruleset)
    return stretches, noise_within(recording, stretches, noise)


@once
def settled_stretches(recording: Recording, ruleset: Ruleset) -> Stretches:
    """Settled stretches by all readings that some observer uses."""
    return find_stretches(recording, ruleset, noise_at_work(recording, ruleset))


def noise_within(
    recording: Recording, stretches: Stretches, noise: Mapping[str, float]
) -> dict[str, float]:
    """Noise of every reading within stretches, SI; as given where they show none."""
    within = _within(stretches, len(recording))
    return {
        name: _noise_of_second(np.diff(values, 2)[within], noise[name])
        for name, values in recording.values.items()
    }


def _within(stretches: Stretches, samples: int) -> np.ndarray:
    """Which second differences lie within one stretch, shape (samples - 2,)."""
    stretch = np.full(samples, -1)
    for i, (low, high) in enumerate(zip(stretches.first, stretches.last, strict=True)):
        stretch[low:high] = i
    within: np.ndarray = (stretch[2:] >= 0) & (stretch[2:] == stretch[:-2])
    return within


@once
def noise_at_work(recording: Recording, ruleset: Ruleset) -> dict[str, float]:
    """Noise of every reading, SI, without the samples in which its module stands.

    A pump that stands most of the time shows no noise in most samples; its readings while it
    runs would then all count as jumps.
    """
    signals = ruleset.signal_by_id
    return {
        name: noise_of(_working(signals[name], values)) for name, values in recording.values.items()
    }


def _working(signal: SignalSpec, values: Array) -> Array:
    """Readings not below the smallest one at which the equations hold."""
    if signal.minimum is None:
        return values
    with np.errstate(invalid="ignore"):
        working: Array = values[values >= signal.minimum]
    return working


def systematic_u(signal: SignalSpec, values: Array | float) -> Array:
    """Systematic standard uncertainty of readings, SI."""
    size = {
        "full scale": signal.full_scale or 0.0,
        "reading": np.abs(np.asarray(values) - signal.offset),
        "value": 1.0,
    }[signal.kind]
    return signal.standard * np.asarray(size, dtype=float)


def find_stretches(
    recording: Recording,
    ruleset: Ruleset,
    noise: Mapping[str, float],
    observers: Sequence[ObserverSpec] | None = None,
    longest: int = limits.LONGEST_STRETCH,
    ramps: bool = False,
) -> Stretches:
    """Settled stretches by all readings that some observer (or one of those given) uses.

    With `ramps` readings may move evenly: a stretch ends only where a rate changes at once.
    """
    n = len(recording)
    breaks = np.zeros(n, dtype=bool)
    breaks[0] = True
    steps = np.diff(recording.time)
    if n > 1:
        breaks[1:] |= steps > limits.PAUSE * np.median(steps)
        breaks[1:] |= np.diff(recording.segment) != 0
    used = {s for o in observers or ruleset.observers for s in o.signals}
    jumps = np.zeros(n, dtype=bool)
    levels: list[Array] = []
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or signal.id not in used:
            continue
        working = _working(signal, values)
        level = np.nanmedian(np.abs(working)) if np.isfinite(working).any() else 0.0
        floor = float(systematic_u(signal, level))
        limit = max(limits.JUMP * np.sqrt(2.0) * noise[signal.id], floor)
        levels.append(
            values
            / max(limits.SETTLED * noise[signal.id], floor * limits.NO_CHANGE, limits.LEAST_NOISE)
        )
        readable = np.isfinite(values)
        latest = np.maximum.accumulate(np.where(readable, np.arange(n), 0))
        with np.errstate(invalid="ignore"):
            if ramps:
                # A second difference has three times the variance of a first one.
                bend = max(limits.JUMP * np.sqrt(6.0) * noise[signal.id], floor)
                jumps[2:] |= np.abs(np.diff(values[latest], 2)) > bend
            else:
                jumps[1:] |= np.abs(np.diff(values[latest])) > limit
            jumps |= _shifts(values[latest], max(limit / np.sqrt(limits.SHORTEST_STRETCH), floor))
        breaks[_edges_of_long(~readable)] = True
    return _cut(breaks | jumps, jumps, np.array(levels).reshape(-1, n), longest)


def _shifts(values: Array, limit: float) -> np.ndarray:
    """First samples of a new level: where the means before and behind differ most, and enough.

    Means over a few samples show a step that the noise hides between two samples. On a slope the
    values change within the means as well: that is drift or settling, and no end.
    """
    n = limits.SHORTEST_STRETCH
    found = np.zeros(len(values), dtype=bool)
    readable = np.isfinite(values)
    if len(values) < 2 * n or not readable.any():
        return found
    # Only before the first reading is there none: that is no shift.
    known = np.where(readable, values, values[np.argmax(readable)])
    sums = np.concatenate([[0.0], np.cumsum(known)])
    means = (sums[n:] - sums[:-n]) / n
    within = _ranges(known, n)
    size = np.abs(means[n:] - means[:-n])
    padded = np.concatenate([[-np.inf], size, [-np.inf]])
    peak = (padded[1:-1] > padded[:-2]) & (padded[1:-1] >= padded[2:]) & (size > limit)
    step = 2.0 * np.maximum(within[n:], within[:-n]) < size
    found[n : n + len(size)] = peak & step
    return found


def _ranges(values: Array, n: int) -> Array:
    """Largest less smallest of each n values in a row."""
    count = len(values) - n + 1
    low = high = values[:count]
    for place in range(1, n):
        low = np.minimum(low, values[place : place + count])
        high = np.maximum(high, values[place : place + count])
    return high - low


def _edges_of_long(blank: np.ndarray) -> np.ndarray:
    """First samples of, and behind, runs without reading; shorter ones do not end a stretch."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], blank, [False]]).astype(int)))
    long = edges.reshape(-1, 2)[edges[1::2] - edges[::2] >= limits.SHORTEST_STRETCH].ravel()
    return long[long < len(blank)]


def _cut(ends: np.ndarray, jumps: np.ndarray, levels: Array, longest: int) -> Stretches:
    """Runs between ends; the sample behind a jump may still average over it and is left out."""
    starts = np.flatnonzero(ends)
    stops = np.append(starts[1:], len(ends))
    first, last = [], []
    for start, stop in zip(starts, stops, strict=True):
        begin = _settled_from(levels, int(start) + 1, int(stop)) if jumps[start] else start
        pieces = max(1, -(-(stop - begin) // longest))
        edges = np.linspace(begin, stop, pieces + 1).astype(int)
        for low, high in pairwise(edges):
            if high - low >= limits.SHORTEST_STRETCH:
                first.append(low)
                last.append(high)
    return Stretches(np.array(first, dtype=int), np.array(last, dtype=int))


def _settled_from(levels: Array, begin: int, stop: int) -> int:
    """First sample from which on no reading differs from the next few by more than its noise.

    `levels` are readings in units of what still counts as noise, shape (signals, n).
    """
    middle = (limits.PERSISTENCE + 1) / 2
    latest = min(begin + limits.SETTLING, stop - limits.PERSISTENCE)
    for low in range(begin, latest):
        rest = levels[:, low + 1 : min(low + 1 + limits.LONGEST_STRETCH, stop)]
        drift = medians(np.diff(rest, axis=1)) * middle
        ahead = medians(rest[:, : limits.PERSISTENCE]) - drift
        if not np.any(np.abs(levels[:, low] - ahead) > 1.0):
            return low
    return max(begin, latest)
