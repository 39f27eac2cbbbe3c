"""Passes over a column of readings, with NaN where there is none: medians, runs, gaps, means,
glitches, thinning.

A column fits into memory, a recording need not: see `larger_than_memory.py`.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import SignalSpec
from rulec_runtime.recordings import limits

Flags = np.ndarray


def first_reading(values: Array) -> float | None:
    """The first number of a column, or None."""
    finite = np.isfinite(values)
    return float(values[np.argmax(finite)]) if finite.any() else None


def median_of(values: Array) -> float:
    """The median of all readings, NaN without one."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else float("nan")


def runs_where(flags: Flags, least: int) -> list[tuple[int, int]]:
    """First and end (excluded) of runs of flags of at least `least`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return _long(edges[::2], edges[1::2], least)


def runs_of_same(values: Array, least: int) -> tuple[list[tuple[int, int]], int]:
    """Runs of equal numbers of at least `least`, first and end (excluded), and the length of the
    longest shorter run, at least 1."""
    with np.errstate(invalid="ignore"):
        changes = np.flatnonzero(values[1:] != values[:-1]) + 1
    edges = np.concatenate([[0], changes, [len(values)]])
    lengths = np.diff(edges)
    shorter = int(np.max(lengths, where=lengths < least, initial=1))
    return _long(edges[:-1], edges[1:], least), shorter


def _long(starts: np.ndarray, stops: np.ndarray, least: int) -> list[tuple[int, int]]:
    keep = stops - starts >= least
    return list(zip(starts[keep].tolist(), stops[keep].tolist(), strict=True))


def held(values: Array) -> Array:
    """Readings whose gaps hold the last one; before the first there is NaN."""
    finite = np.isfinite(values)
    latest = np.maximum.accumulate(np.where(finite, np.arange(len(values)), -1))
    return np.where(latest < 0, np.nan, values[np.maximum(latest, 0)])


def interval_of(time: Array, unknown: float) -> float:
    """The median time between samples, s; `unknown` for fewer than two."""
    return float(np.median(np.diff(time))) if len(time) > 1 else unknown


def sums_between(values: Array, first: np.ndarray, last: np.ndarray) -> Array:
    """Sums of the samples ``first : last`` of stretches in order of time, shape (n,)."""
    if not len(first):
        return np.zeros(0)
    edges = np.column_stack([first, last]).ravel()
    # A stretch that ends with the samples needs no edge.
    inside = edges[:-1] if edges[-1] == len(values) else edges
    sums: Array = np.add.reduceat(values, np.minimum(inside, len(values) - 1))[::2]
    return np.where(last > first, sums, 0.0)


def means_between(
    values: Array,
    first: np.ndarray,
    last: np.ndarray,
    usable: Callable[[Array], Array] = lambda values: values,
) -> tuple[Array, Array]:
    """Means of the samples ``first : last`` that have a reading, and the number of these.

    `usable` replaces unusable numbers by NaN. Stretches are in order of time.
    """
    number = (last - first).astype(float)
    readings = usable(values)
    finite = np.isfinite(readings)
    if not finite.all():
        number = sums_between(finite.astype(float), first, last)
        readings = np.where(finite, readings, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = sums_between(readings, first, last) / number
    return means, number


def nearest(base: Array, own: Array) -> NDArray[np.intp]:
    """Index of the time of `base`, in order, nearest to each time of `own`."""
    behind = np.clip(np.searchsorted(base, own), 1, max(len(base) - 1, 1))
    before, behind = behind - 1, np.minimum(behind, len(base) - 1)
    return np.where(own - base[before] <= base[behind] - own, before, behind)


def glitches_in(values: Array) -> np.ndarray:
    """Flags of single readings far from both neighbours, shape (n,)."""
    step = np.abs(np.diff(values))
    usual = common.NORMAL_SPREAD * float(np.nanmedian(step)) if np.isfinite(step).any() else 0.0
    usual = max(usual, 1e-12 + limits.LEAST_USUAL_STEP * float(np.nanstd(values)))
    odd = np.zeros(len(values), dtype=bool)
    before, after = values[1:-1] - values[:-2], values[1:-1] - values[2:]
    with np.errstate(invalid="ignore"):
        nearer = np.minimum(abs(before), abs(after))
        odd[1:-1] = (before * after > 0) & (nearer > limits.GLITCH * usual)
    return odd


def without_glitches(values: Array) -> tuple[Array, int]:
    """Readings with NaN for glitches, and the number of these."""
    odd = glitches_in(values)
    return np.where(odd, np.nan, values), int(odd.sum())


def thinned(
    time: Array, inputs: Mapping[str, Array], measured: Mapping[str, Array], factor: int
) -> tuple[Array, dict[str, Array], dict[str, Array]]:
    """Averages of neighbours: inputs over the time for which they hold, readings around its
    start."""
    if factor == 1:
        return time, dict(inputs), dict(measured)
    count, before = len(time) // factor, np.full(factor // 2, np.nan)

    def mean(values: Array) -> Array:
        table = values[: count * factor].reshape(count, factor)
        finite = np.isfinite(table)
        with np.errstate(invalid="ignore"):
            result: Array = np.where(finite, table, 0.0).sum(axis=1) / finite.sum(axis=1)
        return result

    return (
        time[: count * factor : factor].copy(),
        {n: mean(v) for n, v in inputs.items()},
        {n: mean(np.concatenate([before, v])) for n, v in measured.items()},
    )


def filled(values: Array) -> Array:
    """Gaps hold the last value; those at the beginning take the first."""
    found, first = held(values), first_reading(values)
    return found if first is None else np.where(np.isnan(found), first, found)


def resolution(values: Array, signal: SignalSpec) -> float:
    """Smallest step between readings over root 12, or a thousandth of their spread."""
    finite = values[np.isfinite(values)]
    steps = np.diff(np.unique(finite))
    steps = steps[steps > limits.SAME_LEVEL * (abs(signal.factor) + np.ptp(finite))]
    smallest = float(np.quantile(steps, limits.FINEST_STEPS)) if len(steps) else abs(signal.factor)
    span = float(np.nanstd(values))
    rounding = min(smallest / np.sqrt(12.0), limits.COARSEST_RESOLUTION * span)
    return float(max(rounding, limits.FINEST_RESOLUTION * span, limits.LEAST_NOISE))


def scale_interval(shown: Array, fewest: int) -> float:
    """The step of a display of fewer than `fewest` levels, in its own unit: 1, 2 or 5 of the last
    decimal place that all readings have, or that place; 0 if they need too many places.

    Source: scale intervals, OIML R 76-1.

    >>> scale_interval(np.tile([16.5, 17.5, 18.5, 19.0], 20), 10)
    0.5
    >>> scale_interval(np.tile([16.4, 17.5, 18.500001], 20), 10)
    0.0
    """
    finite = shown[np.isfinite(shown)]
    levels = np.unique(np.round(finite, limits.MOST_PLACES))
    if not 2 <= len(levels) < min(fewest, len(finite) / limits.COARSE_SHOWN):
        return 0.0
    for places in range(limits.MOST_PLACES):
        if np.array_equal(np.round(levels, places), levels):
            counts = np.round(np.diff(levels) * 10.0**places).astype(np.int64)
            step = int(np.gcd.reduce(counts))
            return (step if step in (1, 2, 5) else 1) / 10.0**places
    return 0.0


def coarse_step(values: Array, least: float, fewest: int = limits.COARSE_LEVELS) -> float:
    """The step of a display of at least `fewest` levels, if it is larger than `least`; else 0."""
    finite = values[np.isfinite(values)]
    levels = np.unique(finite)
    if not fewest <= len(levels) <= len(finite) / limits.COARSE_SHOWN:
        return 0.0
    steps = np.diff(levels)
    step = float(np.min(steps))
    even = np.abs(steps / step - np.round(steps / step)) < limits.COARSE_UNEVEN
    return step if step > least and even.all() else 0.0
