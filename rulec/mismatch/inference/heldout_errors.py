"""Errors of the shipped, the recalibrated and the repaired model on held-out samples."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import SignalSpec
from rulec_runtime.output.csv_cell import row_of

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.model import Line
from rulec.mismatch.inference import limits
from rulec.mismatch.result import Confounded, Course, Errors, Fit, Series


def profile(line: Line) -> tuple[float, float]:
    """95 % interval of a value by its profile likelihood, SI: where the likelihood has fallen by
    enough on each side, within the range.

    Source: Venzon and Moolgavkar 1988.
    """
    ends = []
    for side, most in ((-1.0, line.value - line.lowest), (1.0, line.highest - line.value)):
        step, inside, outside = min(common.NORMAL_95 * line.u, most), 0.0, np.inf
        for _ in range(limits.PROFILE_STEPS):
            if step <= 0.0:
                break
            fall = line.fall(side * step)
            if fall < common.DROP:
                inside = step
                if step >= most:
                    break
                grow = float(np.clip(np.sqrt(common.DROP / max(fall, 1e-300)), *limits.GROWTH))
                between = 0.5 * (inside + outside) if np.isfinite(outside) else most
                step = min(step * grow, most, between)
            else:
                outside = step
                step = max(step * float(np.sqrt(common.DROP / fall)), 0.25 * (inside + outside))
            if abs(fall - common.DROP) < limits.PROFILE_NEAR:
                break
        ends.append(float(line.value + side * step))
    low, high = ends
    return low, high


def confounded(
    names: Sequence[str], covariance: Array, unknowns: frozenset[str]
) -> tuple[Confounded, ...]:
    """Unknowns of explanations that correlate with another value, the most correlated first.

    `covariance`, shape (names, names), is that of the values with these names.
    """
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    # A value that nothing determines has a variance of rounding errors, perhaps below 0.
    correlation = np.clip(covariance / np.outer(size, size), -1.0, 1.0)
    found = [
        Confounded(first, second, float(correlation[i, j]))
        for i, first in enumerate(names)
        for j, second in enumerate(names)
        if first in unknowns and (second not in unknowns or j > i)
        if abs(correlation[i, j]) > limits.CONFOUNDED
    ]
    return tuple(sorted(found, key=lambda pair: -abs(pair.correlation)))


MODELS = ("shipped", "recalibrated", "repaired")


class Predicted(NamedTuple):
    """Predictions of the models, SI, shape (n,) each."""

    shipped: Array
    recalibrated: Array
    repaired: Array


def course_of(signal: SignalSpec, measured: Array, predicted: Predicted) -> Course:
    """Reading and predictions, given in SI, shape (n,), in the unit of the signal."""
    arrays = {"measured": measured, **predicted._asdict()}
    shown = {name: (values - signal.offset) / signal.factor for name, values in arrays.items()}
    return Course(signal=signal.id, unit=signal.unit, **shown)


def series_csv(series: Series | None) -> str:
    """A row per sample; a cell is empty without a reading or prediction."""
    if series is None:
        return "time [s],heldout [1]\n"
    head = ["time [s]", "heldout [1]"]
    columns = [
        [f"{time:.10g}" for time in series.time],
        ["1" if flag else "0" for flag in series.heldout],
    ]
    for course in series.courses:
        for name in ("measured", *MODELS):
            head.append(f"{course.signal} {name} [{course.unit}]")
            values = getattr(course, name)
            columns.append([f"{v:.9g}" if math.isfinite(v) else "" for v in values])
    return "\n".join([row_of(head), *map(",".join, zip(*columns, strict=True))]) + "\n"


def heldout_spans(time: Array, heldout: Sequence[bool] | np.ndarray) -> list[tuple[float, float]]:
    """Spans of time, s, that contain exactly the held-out samples; both shape (n,).

    They end midway to the neighbours, as a sample may be a mean over some time around it.

    >>> heldout_spans(np.array([0.0, 1.0, 2.0, 3.0, 4.0]), [False, True, True, False, True])
    [(0.5, 2.5), (3.5, 4.5)]
    """
    flags = np.asarray(heldout, dtype=bool)
    if not flags.any():
        return []
    middles = (time[1:] + time[:-1]) / 2
    first = 2 * time[0] - middles[0] if len(middles) else time[0]
    last = 2 * time[-1] - middles[-1] if len(middles) else time[-1]
    edges = np.concatenate([[first], middles, [last]])
    turns = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(float(edges[a]), float(edges[b])) for a, b in turns.reshape(-1, 2)]


@dataclass(frozen=True)
class Proof:
    """The fit of one reading as shown, and the predictions of the three models.

    `judged`, shape (n,), flags samples whose errors count.
    """

    fit: Fit
    predicted: Predicted
    judged: np.ndarray


def fit_of(
    signal: SignalSpec,
    errors: Sequence[Array],
    noise: tuple[float, float],
    parts: tuple[np.ndarray, np.ndarray],
    explained: tuple[float, float] = (np.nan, np.nan),
) -> Fit:
    """The errors of a reading as shown.

    Parameters
    ----------
    errors : predicted minus measured of shipped, recalibrated and repaired model, SI, shape (n,).
    noise : root mean square of the noise of the reading in both parts, SI.
    parts : flags of the open and of the held-out samples, shape (n,).
    explained : errors of the whole explanation in both parts, as shown.
    """
    finite = np.all([np.isfinite(e) for e in errors], axis=0)
    shown = [e / signal.factor for e in errors]
    inside = [part & finite for part in parts]
    estimation, heldout = (
        Errors(
            shipped=rms(shown[0][part]),
            recalibrated=rms(shown[1][part]),
            repaired=rms(shown[2][part]),
            noise=size / signal.factor,
            points=int(part.sum()),
            explained=own,
        )
        for part, size, own in zip(inside, noise, explained, strict=True)
    )
    # Negative if the repair makes it worse; NaN if nothing was held out or explainable.
    explainable = heldout.recalibrated**2 - heldout.noise**2
    gained = heldout.recalibrated**2 - heldout.repaired**2
    closed = np.clip(gained / explainable, -1.0, 1.0) if explainable > 0 else np.nan
    return Fit(
        signal=signal.id,
        unit=signal.unit,
        estimation=estimation,
        heldout=heldout,
        gain_interval=gain_interval(shown[1][inside[1]], shown[2][inside[1]]),
        closed=float(closed),
    )


def rms(values: Array) -> float:
    """Root mean square of values, shape (n,); NaN for none."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def gain_interval(before: Array, after: Array) -> tuple[float, float]:
    """95 % interval of the fall of the error, as a share of the error before; shape (n,) each.

    Source: bootstrap over blocks of consecutive points (Kunsch 1989).
    """
    if len(before) < 2:
        return (float("nan"), float("nan"))
    count = min(limits.CHUNKS, len(before))
    edges = np.linspace(0, len(before), count + 1).astype(int)[:-1]
    sums = np.stack([np.add.reduceat(e**2, edges) for e in (before, after)])
    drawn = np.random.default_rng(0).integers(0, count, (limits.DRAWS, count))
    totals = sums[:, drawn].sum(axis=2)
    gain = 1.0 - np.sqrt(totals[1] / np.maximum(totals[0], 1e-300))
    low, high = np.quantile(gain, [0.025, 0.975])
    return float(low), float(high)
