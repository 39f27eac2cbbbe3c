"""A recording as the analysis of a plant that stores reads it: even in time, split into blocks."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.mismatch.dynamic.noise import Flags
from runtime.mismatch.dynamic.quality import glitches_in
from runtime.mismatch.prepare import ESTIMATION, HELDOUT, PATTERN, SELECTION
from runtime.plan import Array
from runtime.recording import Recording
from runtime.ruleset import Ruleset, SignalSpec

BUDGET = 4096
"""Samples at most; neighbours of longer recordings are averaged."""

BLOCKS = 25
"""Blocks of a recording."""


@dataclass(frozen=True)
class Record:
    """Samples in order of time.

    `inputs` holds what is given, all finite, `measured` what sensors showed, NaN where they show
    nothing; both per signal an array, shape (n,), SI. `resolution` is the step in which a reading
    moves at least. `glitches` counts readings that were set aside, per signal.
    """

    time: Array
    inputs: Mapping[str, Array]
    measured: Mapping[str, Array]
    resolution: Mapping[str, float]
    glitches: Mapping[str, int]
    part: NDArray[np.intp]
    block: NDArray[np.intp]
    split: str
    digest: str

    @property
    def open(self) -> Flags:
        """Samples that may be looked at before the end."""
        flags: Flags = self.part != HELDOUT
        return flags


def record_of(
    recording: Recording,
    ruleset: Ruleset,
    given: Sequence[str],
    heldout: Sequence[tuple[float, float]] = (),
) -> Record | None:
    """Prepare a recording; None where a reading that is given, or every predicted one, is missing.

    Parameters
    ----------
    given : signals that no equation predicts.
    """
    dynamics = ruleset.dynamics
    assert dynamics is not None
    if any(n not in recording.values for n in dynamics.inputs):
        return None
    shown = [n for n in dynamics.outputs if n in recording.values]
    measured: dict[str, Array] = {}
    glitches: dict[str, int] = {}
    for name in shown:
        odd = glitches_in(recording.values[name])
        measured[name] = np.where(odd, np.nan, recording.values[name])
        glitches[name] = int(odd.sum())
    inputs = {n: v for n, v in recording.values.items() if n in given}
    time, inputs, measured = _thinned(recording.time, inputs, measured)
    inputs = {n: _filled(v) for n, v in inputs.items() if np.isfinite(v).any()}
    if any(n not in inputs for n in dynamics.inputs) or len(time) < BLOCKS:
        return None
    measured = {n: v for n, v in measured.items() if np.isfinite(v).sum() > BLOCKS}
    if not measured:
        return None
    block, part = _split(time, inputs, heldout)
    digest = hashlib.sha256(time.tobytes() + part.astype("i1").tobytes()).hexdigest()[:16]
    resolution = {n: _resolution(recording.values[n], ruleset.signal_by_id[n]) for n in measured}
    text = _told(time, part, heldout)
    return Record(time, inputs, measured, resolution, glitches, part, block, text, digest)


def _thinned(
    time: Array, inputs: Mapping[str, Array], measured: Mapping[str, Array]
) -> tuple[Array, dict[str, Array], dict[str, Array]]:
    """Neighbours averaged: inputs over the time for which they hold, readings around its start."""
    factor = -(-len(time) // BUDGET)
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

    thin = time[:used].reshape(count, factor)[:, 0]
    return (
        np.ascontiguousarray(thin),
        {n: mean(v) for n, v in inputs.items()},
        {n: around(v) for n, v in measured.items()},
    )


def _filled(values: Array) -> Array:
    """Gaps hold the last value; before the first one stands the first."""
    known = np.isfinite(values)
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    first = int(np.argmax(known))
    result: Array = values[np.maximum(last, first)]
    return result


def _resolution(values: Array, signal: SignalSpec) -> float:
    """Smallest step between readings over root 12, or a thousandth of what they span."""
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    steps = steps[steps > 1e-9 * (abs(signal.factor) + np.ptp(values[np.isfinite(values)]))]
    smallest = float(np.quantile(steps, 0.05)) if len(steps) else abs(signal.factor)
    span = float(np.nanstd(values))
    return float(max(min(smallest / np.sqrt(12.0), 0.05 * span), 1e-4 * span, 1e-300))


def _split(
    time: Array, inputs: Mapping[str, Array], heldout: Sequence[tuple[float, float]]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Number of the block of each sample, and what it serves for.

    Which blocks are set aside follows from what is given alone: those whose inputs are most like
    the others', so that what is proved there was also there to be learnt.
    """
    n = len(time)
    block = np.arange(n) * BLOCKS // n
    if heldout:
        inside = np.zeros(n, dtype=bool)
        for low, high in heldout:
            inside |= (time >= low) & (time <= high)
        return block, np.where(inside, HELDOUT, np.array([ESTIMATION, SELECTION])[block % 2])
    turns = [np.roll(PATTERN, shift) for shift in range(len(PATTERN))]
    parts = [turn[block % len(PATTERN)] for turn in turns]
    return block, min(parts, key=lambda part: _unlike(inputs, part == HELDOUT, n // BLOCKS))


def _unlike(inputs: Mapping[str, Array], flags: NDArray[np.bool_], length: int) -> float:
    """Largest distance between the distributions of smoothed inputs (Kolmogorov, Smirnov)."""
    far = 0.0
    for course in inputs.values():
        smooth = np.convolve(course, np.ones(length) / length)[: len(course)]
        levels = np.quantile(smooth, np.linspace(0.0, 1.0, 41))
        inside, outside = np.sort(smooth[flags]), np.sort(smooth[~flags])
        shares = [np.searchsorted(v, levels, "right") / len(v) for v in (inside, outside)]
        far = max(far, float(np.max(np.abs(shares[0] - shares[1]))))
    return round(far, 3)


def _told(time: Array, part: NDArray[np.intp], heldout: Sequence[object]) -> str:
    counts = [int((part == p).sum()) for p in (ESTIMATION, SELECTION, HELDOUT)]
    chosen = "as asked" if heldout else "every fifth block, by the inputs"
    return (
        f"{len(time)} samples in {BLOCKS} blocks of time: {counts[0]} for estimation, {counts[1]} "
        f"for selection, {counts[2]} held out ({chosen}); simulation runs through all of them"
    )
