"""Thin and clean samples: average neighbours, fill gaps of inputs, remove glitches."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import SignalSpec
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.columns import first_reading, held


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
    count = len(time) // factor
    used = count * factor
    shift = factor // 2

    def mean(values: Array) -> Array:
        table = values[:used].reshape(count, factor)
        known = np.isfinite(table)
        total = np.where(known, table, 0.0).sum(axis=1)
        with np.errstate(invalid="ignore"):
            result: Array = np.where(known.any(axis=1), total / known.sum(axis=1), np.nan)
        return result

    def around(values: Array) -> Array:
        return mean(np.concatenate([np.full(shift, np.nan), values])[: len(values)])

    return (
        np.ascontiguousarray(time[:used].reshape(count, factor)[:, 0]),
        {n: mean(v) for n, v in inputs.items()},
        {n: around(v) for n, v in measured.items()},
    )


def filled(values: Array) -> Array:
    """Gaps hold the last value; those at the beginning take the first."""
    found, first = held(values), first_reading(values)
    return found if first is None else np.where(np.isnan(found), first, found)


def resolution(values: Array, signal: SignalSpec) -> float:
    """Smallest step between readings over root 12, or a thousandth of their spread."""
    known = values[np.isfinite(values)]
    steps = np.diff(np.unique(known))
    steps = steps[steps > limits.SAME_LEVEL * (abs(signal.factor) + np.ptp(known))]
    smallest = float(np.quantile(steps, limits.FINEST_STEPS)) if len(steps) else abs(signal.factor)
    span = float(np.nanstd(values))
    rounding = min(smallest / np.sqrt(12.0), limits.COARSEST_RESOLUTION * span)
    return float(max(rounding, limits.FINEST_RESOLUTION * span, limits.LEAST_NOISE))
