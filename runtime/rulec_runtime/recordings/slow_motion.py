"""Use readings in slow motion: which samples are usable, and how large their error may be.

A law holds for readings of one moment. A reading that lags shows an earlier state: to first order
its error is its lag times its rate of change. The lag of a sensor is constant, so this error has
one sign along a ramp and does not average out.

Source: own derivation, docs/method.md; the first order of a lag in time.
"""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.columns import means_between, runs_where
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import (
    Stretches,
    cut,
    find_stretches,
    flags_of,
    noise_at_work,
    noise_within,
    settled_stretches,
    systematic_u,
)


def settle_or_slow(recording: Recording, ruleset: Ruleset) -> tuple[Stretches, dict[str, float]]:
    """Settled stretches and pieces of slow motion between them, in order of time, and the noise of
    every reading while settled, SI."""
    noise = noise_at_work(recording, ruleset)
    settled = settled_stretches(recording, ruleset)
    stretches = _with_slow(settled, recording, ruleset, noise)
    return stretches, noise_within(recording, settled, noise)


def _with_slow(
    settled: Stretches, recording: Recording, ruleset: Ruleset, noise: Mapping[str, float]
) -> Stretches:
    """Settled stretches, and the parts between them of stretches in which readings move evenly.

    Moving parts are cut into short pieces, since laws are not linear.
    """
    if recording.interval > limits.LARGEST_INTERVAL:
        return settled
    smooth = find_stretches(recording, ruleset, noise, ramps=True)
    samples = int(max(smooth.last.max(initial=0), settled.last.max(initial=0)))
    free = flags_of(samples, smooth.first, smooth.last)
    free &= ~flags_of(samples, settled.first, settled.last)
    starts = flags_of(samples, smooth.first, smooth.first + 1)
    first, last = settled.first.tolist(), settled.last.tolist()
    for low, high in runs_where(free, 1):
        inside = np.flatnonzero(starts[low + 1 : high]) + low + 1
        for begin, stop in pairwise([low, *inside.tolist(), high]):
            firsts, lasts = cut(begin, stop, (stop - begin) // limits.LONGEST_SLOW)
            first += firsts
            last += lasts
    order = np.argsort(first, kind="stable")
    return Stretches(np.array(first, dtype=np.intp)[order], np.array(last, dtype=np.intp)[order])


def lag_errors(
    recording: Recording, ruleset: Ruleset, stretches: Stretches, noise: Mapping[str, float]
) -> dict[str, Array]:
    """Mean error of each reading per stretch for a lag of one standard uncertainty: SI, with the
    sign of its rate, shape (n,); readings that never move are left out.

    A rate within the noise, or with a negligible effect, counts as 0.
    """
    found: dict[str, Array] = {}
    if recording.interval > limits.LARGEST_INTERVAL:
        return found
    lag = lag_u(recording)
    between, _ = _apart(recording.time, stretches)
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or not len(stretches):
            continue
        apart, shares = _apart(values, stretches)
        with np.errstate(invalid="ignore", divide="ignore"):
            rate, u = apart / between, noise[signal.id] * np.sqrt(shares) / between
        level = means_between(values, stretches.first, stretches.last)[0]
        least = common.NO_CHANGE * systematic_u(signal, level)
        with np.errstate(invalid="ignore"):
            moves = (np.abs(rate) > common.THRESHOLD * u) & (lag * np.abs(rate) > least)
        if moves.any():
            found[signal.id] = np.where(moves, lag * rate, 0.0)
    return found


def lag_u(recording: Recording) -> float:
    """Standard uncertainty of the lag of a reading, s: that of its sensor, and that of a logger
    whose values may be up to one sample old."""
    return float(np.hypot(limits.USUAL_LAG, limits.AGE_OF_SAMPLE * recording.interval))


def _apart(values: Array, stretches: Stretches) -> tuple[Array, Array]:
    """The mean of the second half of each stretch minus that of the first, and the variance of this
    difference in units of that of a reading. Shape (n,) each."""
    length = np.maximum(stretches.lengths // 2, 1)
    early, number = means_between(values, stretches.first, stretches.first + length)
    late, behind = means_between(values, stretches.last - length, stretches.last)
    with np.errstate(invalid="ignore", divide="ignore"):
        return late - early, 1.0 / number + 1.0 / behind
