"""Find the stretches in which the plant is steady enough to be judged.

The relations of a ruleset hold for settled operation. A stretch ends where a reading jumps by more
than its noise and its sensor's uncertainty explain; slow drift does not end it. The noise is
estimated from the median of second differences, which steps and slopes hardly affect.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import ObserverSpec, Ruleset, SignalSpec
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.columns import (
    first_reading,
    held,
    interval_of,
    median_of,
    runs_where,
)
from rulec_runtime.recordings.recording import Recording, once
from rulec_runtime.recordings.robust_statistics import white_noise


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
    """Times of stretches, also without their samples.

    Attributes
    ----------
    since, until : shape (n,), s, times of first and last sample.
    samples : shape (n,), number of samples.
    later : shape (n,), number of samples after it.
    paused : shape (n,), whether a long pause precedes it.
    """

    since: Array
    until: Array
    samples: NDArray[np.intp]
    later: NDArray[np.intp]
    paused: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.since)


def timeline_of(time: Array, stretches: Stretches) -> Timeline:
    """Times of the stretches of a recording."""
    since, until = time[stretches.first], time[stretches.last - 1]
    paused = np.zeros(len(stretches), dtype=bool)
    paused[1:] = since[1:] - until[:-1] > long_pause(time)
    return Timeline(since, until, stretches.lengths, len(time) - stretches.last, paused)


def flags_of(count: int, first: NDArray[np.intp], last: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Flags of samples ``first : last`` of some stretches, shape (count,)."""
    found = np.zeros(count, dtype=bool)
    for a, b in zip(first.tolist(), last.tolist(), strict=True):
        found[a : max(a, b)] = True
    return found


def long_pause(time: Array) -> float:
    """Shortest time without samples, s, after which stretches are unrelated."""
    return common.LONGEST_STRETCH * interval_of(time, np.inf)


def noise_of(values: Array) -> float:
    """Standard deviation of white noise in a record, by second differences of its readings, which
    steps and slopes hardly affect; of a coarse display that mostly shows the same number, whose
    differences are mostly 0, that of its flicker."""
    return white_noise(np.diff(values[np.isfinite(values)], 2), 2) or _flicker_of(values)


def _flicker_of(values: Array) -> float:
    """Standard deviation of samples between two equal ones; 0 if few differ from these."""
    step = np.abs(values[1:-1] - values[:-2])[values[2:] == values[:-2]]
    other = step > 0.0
    if other.sum() < limits.FLICKERS:
        return 0.0
    return float(np.median(step[other]) * np.sqrt(np.mean(other)))


def settle(recording: Recording, ruleset: Ruleset) -> tuple[Stretches, dict[str, float]]:
    """Settled stretches, and the noise of every reading within them, SI."""
    noise = noise_at_work(recording, ruleset)
    stretches = settled_stretches(recording, ruleset)
    return stretches, noise_within(recording, stretches, noise)


@once
def settled_stretches(recording: Recording, ruleset: Ruleset) -> Stretches:
    """Settled stretches by all readings that an observer uses."""
    return find_stretches(recording, ruleset, noise_at_work(recording, ruleset))


def noise_within(
    recording: Recording, stretches: Stretches, noise: Mapping[str, float]
) -> dict[str, float]:
    """Noise of every reading within stretches, SI; as given if they show none."""
    inside = flags_of(max(len(recording) - 2, 0), stretches.first, stretches.last - 2)
    found = dict(noise)
    for name, values in recording.values.items():
        second = np.diff(values, 2)[inside]
        if (finite := np.isfinite(second)).any():
            found[name] = white_noise(second[finite], 2)
    return {name: found[name] for name in recording.values}


@once
def noise_at_work(recording: Recording, ruleset: Ruleset) -> dict[str, float]:
    """Noise of every reading, SI, without the samples in which its module is off.

    A pump that is off most of the time shows no noise in most samples; its readings while it runs
    would then all count as jumps. So would all readings of one that never runs.
    """
    return {
        name: noise_of(_at_work(ruleset.signal_by_id[name], values))
        for name, values in recording.values.items()
    }


def working(signal: SignalSpec, values: Array) -> np.ndarray:
    """Whether readings are large enough for the equations to hold, shape (n,)."""
    finite = np.isfinite(values)
    if signal.minimum is None:
        return finite
    with np.errstate(invalid="ignore"):
        found: np.ndarray = finite & (values >= signal.minimum)
    return found


def _at_work(signal: SignalSpec, values: Array) -> Array:
    """Readings while the module works; all if it hardly does."""
    found = values[working(signal, values)]
    return found if len(found) >= common.SHORTEST_STRETCH else values[np.isfinite(values)]


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
    longest: int = common.LONGEST_STRETCH,
    ramps: bool = False,
) -> Stretches:
    """Settled stretches by all readings that an observer (of those given, or any) uses.

    With `ramps` readings may move evenly: a stretch ends only where a rate changes abruptly.
    """
    time, segment = recording.time, recording.segment
    breaks, jumps = np.zeros((2, len(recording)), dtype=bool)
    breaks[0] = True
    breaks[1:] = np.diff(time) > common.PAUSE * (recording.interval or np.inf)
    breaks[1:] |= segment[1:] != segment[:-1]
    used = {s for o in observers or ruleset.observers for s in o.signals}
    levels: list[tuple[Array, float]] = []
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or signal.id not in used:
            continue
        level = median_of(np.abs(_at_work(signal, values)))
        floor = float(systematic_u(signal, 0.0 if np.isnan(level) else level))
        limit = max(common.JUMP * np.sqrt(2.0) * noise[signal.id], floor)
        still = max(limits.SETTLED * noise[signal.id], floor * common.NO_CHANGE)
        levels.append((values, max(still, limits.LEAST_NOISE)))
        # A second difference has three times the variance of a first one.
        bend = max(common.JUMP * np.sqrt(6.0) * noise[signal.id], floor)
        filled = held(values)
        order, far = (2, bend) if ramps else (1, limit)
        abrupt = np.zeros(len(filled), dtype=bool)
        with np.errstate(invalid="ignore"):
            abrupt[order:] = np.abs(np.diff(filled, order)) > far
        jumps |= abrupt | _shifts(filled, abrupt, limit, floor)
        # Short runs without a reading end no stretch.
        for first, behind in runs_where(~np.isfinite(values), common.SHORTEST_STRETCH):
            breaks[first] = True
            breaks[behind : behind + 1] = True
    return _cut(breaks, jumps, levels, longest)


def _shifts(filled: Array, abrupt: np.ndarray, limit: float, floor: float) -> np.ndarray:
    """First samples of a new level that no abrupt change (flags, shape (n,)) shows: where the means
    before and after differ most, and enough.

    Means over a few samples reveal a step that noise hides between two samples; over some more, a
    step whose own sample lies between the levels. On a slope the values change within the means as
    well: that is drift or settling, and ends no stretch.
    """
    found, begin = np.zeros(len(filled), dtype=bool), first_reading(filled)
    if begin is None:
        return found
    complete = np.where(np.isfinite(filled), filled, begin)  # before the first reading is no shift
    for n, between in ((common.SHORTEST_STRETCH, 0), (common.PERSISTENCE, 1)):
        apart = n + between
        if len(filled) < apart + n:
            break
        windows = np.lib.stride_tricks.sliding_window_view(complete, n).T
        means, span = windows.sum(axis=0) / n, np.ptp(windows, axis=0)
        size = np.abs(means[apart:] - means[:-apart])
        padded = np.concatenate([[-np.inf], size, [-np.inf]])
        peak = (padded[1:-1] > padded[:-2]) & (padded[1:-1] >= padded[2:])
        step = 2.0 * np.maximum(span[apart:], span[:-apart]) < size
        step &= size > max(limit / np.sqrt(n), floor)
        new = np.flatnonzero(peak & step) + n
        if len(new):
            near = np.convolve(abrupt | found, np.ones(2 * n + 1))[n + new] > 0.5
            found[new[~near]] = True
    return found


Levels = Sequence[tuple[Array, float]]
"""Readings, shape (n,) each, with the scale of what counts as noise."""


def _cut(breaks: np.ndarray, jumps: np.ndarray, levels: Levels, longest: int) -> Stretches:
    """Runs between ends; the sample after a jump may average over it and is left out."""
    first, last = list[int](), list[int]()
    for start, stop in pairwise([*np.flatnonzero(breaks | jumps).tolist(), len(breaks)]):
        begin = _settled_from(levels, start + 1, stop) if jumps[start] else start
        firsts, lasts = cut(begin, stop, -(-(stop - begin) // longest))
        first.extend(firsts)
        last.extend(lasts)
    return Stretches(np.array(first, dtype=np.intp), np.array(last, dtype=np.intp))


def cut(begin: int, stop: int, pieces: int) -> tuple[list[int], list[int]]:
    """First samples and ends (excluded) of about equal pieces of a run, without too short ones."""
    edges = np.linspace(begin, stop, max(1, pieces) + 1).astype(int)
    long = np.diff(edges) >= common.SHORTEST_STRETCH
    return edges[:-1][long].tolist(), edges[1:][long].tolist()


def _settled_from(levels: Levels, begin: int, stop: int) -> int:
    """First sample after which no reading differs from the next few by more than its noise."""
    middle = (common.PERSISTENCE + 1) / 2
    latest = min(begin + common.SETTLING, stop - common.PERSISTENCE)
    if latest <= begin:
        return max(begin, latest)
    stop = min(latest + common.LONGEST_STRETCH, stop)
    table = np.array([values[begin:stop] / scale for values, scale in levels])
    table = table.reshape(-1, stop - begin)
    for low in range(latest - begin):
        rest = table[:, low + 1 : low + 1 + common.LONGEST_STRETCH]
        drift = np.median(np.diff(rest, axis=1), axis=1) * middle
        ahead = np.median(rest[:, : common.PERSISTENCE], axis=1) - drift
        if not np.any(np.abs(table[:, low] - ahead) > 1.0):
            return begin + low
    return max(begin, latest)
