"""A driver that nobody recorded: its course from what is left, and what it looks like."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from runtime.mismatch.fit import Fitted
from runtime.mismatch.locate import Suspect, noise_scale, suspects
from runtime.plan import Array

STRUCTURED = 0.3
"""Share of what is left that a smooth course in time holds, for it to be told."""

PART = 0.15
"""Gain by the course, as share of what all explanations together gain, for it to be told."""

WINDOWS = 60
"""Smoothing windows per recording."""


@dataclass(frozen=True)
class Reconstruction:
    """A smooth course at a place, shape (points,), SI, and the times of it."""

    suspect: Suspect
    time: Array
    course: Array
    share: float


def reconstruct(fitted: Fitted, explained: float) -> Reconstruction | None:
    """The course of an error at the most suspect place, if it is one smooth course in time.

    Parameters
    ----------
    explained : gain in log likelihood of what was explained so far: small change beside it is
        not worth telling.
    """
    data = fitted.rows.system.data
    if data.of_rows:
        return None
    noise = noise_scale(fitted.rows, fitted.residual)
    for suspect in suspects(fitted)[:3]:
        known = np.flatnonzero(np.isfinite(suspect.course) & (suspect.weight > 0))
        if len(known) < 4 * WINDOWS:
            continue
        values, weight = suspect.course[known], suspect.weight[known]
        smooth = _smoothed(values, weight, len(known) // WINDOWS)
        open_ = fitted.used[known]
        left = float(np.average(_clipped(values)[open_] ** 2, weights=weight[open_]))
        held = float(np.average(smooth[open_] ** 2, weights=weight[open_]))
        mere = noise**2 * float(open_.sum() / weight[open_].sum())
        share = held / max(left - mere, 1e-300) if left > 1.05 * mere else 0.0
        gain = -0.5 * float(open_.sum()) * float(np.log1p(-min(held / left, 0.999)))
        price = 2.0 * WINDOWS * float(np.log(len(known)))
        if share > STRUCTURED and gain > price + PART * explained:
            return Reconstruction(suspect, data.time[known], smooth, min(share, 1.0))
    return None


def _clipped(values: Array) -> Array:
    middle = float(np.median(values))
    spread = 1.4826 * float(np.median(np.abs(values - middle))) or float(np.std(values))
    clipped: Array = np.clip(values, middle - 4.0 * spread, middle + 4.0 * spread)
    return clipped


def _smoothed(values: Array, weight: Array, width: int) -> Array:
    """Weighted running mean of clipped values: one odd point is no course."""
    kernel = np.hanning(2 * max(width, 1) + 3)[1:-1]
    top = np.convolve(_clipped(values) * weight, kernel, mode="same")
    smooth: Array = top / np.convolve(weight, kernel, mode="same")
    return smooth


def described(time: Array, course: Array) -> str:
    """What a course looks like, in words that a plant engineer can match to a cause."""
    span = float(np.ptp(course))
    if span == 0:
        return "constant"
    length = float(time[-1] - time[0])
    level = (course - course[0]) / span
    tail = float(np.median(level[-max(len(level) // 5, 1) :]))
    parts = ["slow"]
    if abs(tail) > 0.3:
        reached = np.flatnonzero(np.abs(level) > 0.63 * abs(tail))
        when = float(time[reached[0]] - time[0]) if len(reached) else length
        way = "rises" if tail > 0 else "falls"
        parts.append(f"{way} from the start, two thirds of the way within {_span(when)}")
    turns = _turns(level)
    if turns:
        parts.append(f"turns {turns} time{'s' * (turns > 1)} over {_span(length)}")
    rests = np.diff(time)
    long = np.flatnonzero(rests > 20.0 * np.median(rests))
    back = [i for i in long if abs(level[i + 1]) < 0.5 * abs(level[i])]
    if back:
        parts.append("returns during stops")
    return ", ".join(parts)


def _turns(level: Array) -> int:
    """Changes of direction larger than a third of the span."""
    turns, extreme, direction = 0, float(level[0]), 0
    for value in level:
        if direction >= 0 and value < extreme - 0.33:
            turns += direction > 0
            direction, extreme = -1, float(value)
        elif direction <= 0 and value > extreme + 0.33:
            turns += direction < 0
            direction, extreme = 1, float(value)
        elif direction * (value - extreme) > 0 or direction == 0:
            extreme = max(extreme, float(value)) if direction > 0 else extreme
            extreme = min(extreme, float(value)) if direction < 0 else extreme
    return turns


def _span(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
